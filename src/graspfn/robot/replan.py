"""Planning once more on the image of a recording, with a network at hand: a camera, a unit or a network that changed
since shows in a pose that differs from the recorded one."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graspfn import params
from graspfn.evaluation.bench import Scene
from graspfn.evaluation.planner import GraspFunction, Planner, view
from graspfn.geometry import grid
from graspfn.imaging.camera import Camera
from graspfn.learning.folder import input_kind
from graspfn.learning.networks import GraspNetwork
from graspfn.learning.prediction import predict_both
from graspfn.learning.weights import load_network
from graspfn.params import Gripper, Plan, Table
from graspfn.planning.methods import LIKELIEST, ROBUST
from graspfn.planning.robust import RobustFunction
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.robot.trial import TrialRecording

SAME_M, SAME_RAD = 0.015, np.radians(31)  # a cell of Q and its diagonal: so far rounding to millimetres moves a plan
TIE = 0.02  # share of the best score by which a pose may miss it and count as good: rounding moves scores by less
CERTAIN = PoseUncertainty((0.0, 0.0))


@dataclass(frozen=True, eq=False)
class Replanned:
    """q: (3,) by the trial's own method, None where it finds no grasp; f and robust: (33, 44, 6), the network's
    function where the gripper meets the object, and the same smoothed by the Sigma that the trial assumed; by: whose
    maximum the method takes. refused: why the image is not planned on, "" where it is."""

    q: np.ndarray | None
    f: np.ndarray
    robust: np.ndarray
    by: RobustFunction
    refused: str = ""

    def differs(self, recorded: np.ndarray | None) -> str:
        """In words, how the pose differs from the recorded one; "" where it does not."""
        if self.q is None or recorded is None:
            if self.q is None and recorded is None:
                return ""
            why = f": {self.refused}" if self.refused else ""
            return f"planned again, {'no grasp' if self.q is None else 'a grasp'} is found{why}"
        away = float(np.hypot(*(self.q - recorded)[:2]))
        turned = float(abs(grid.angle_difference(self.q[2], recorded[2])))
        best, then = self.by.at(np.stack([self.q, recorded])).tolist()
        if (away <= SAME_M and turned <= SAME_RAD) or best - then <= TIE * best:
            return ""
        return f"planned again, the pose is {away * 1000:.0f} mm and {np.degrees(turned):.0f}° from the recorded one"


@functools.cache
def _loaded(folder: Path) -> tuple[str, GraspNetwork]:
    """What a network sees (`network.*.input`), and itself: once in each process."""
    return input_kind(folder), load_network(folder)


@dataclass(frozen=True, eq=False)
class Replanner:
    """networks: the folders of those at hand, by the name that recordings give them. camera: whose pose above the table
    is taken; intrinsics are those of each recording."""

    networks: Mapping[str, Path]
    planner: Planner
    camera: Camera
    table: Table
    gripper: Gripper

    @classmethod
    def of(
        cls,
        networks: Mapping[str, Path],
        plan: Plan,
        seed: int,
        camera: params.Camera,
        table: Table,
        gripper: Gripper,
    ) -> Replanner:
        """From the sections of params.yaml."""
        return cls(networks, Planner(plan, seed), Camera.from_params(camera), table, gripper)

    def check(self) -> None:
        """WeightsError where a folder holds no network."""
        for folder in self.networks.values():
            _loaded(folder)

    def differs(self, trial: TrialRecording) -> str:
        """In words, how a plan on the recorded image differs from the recorded one; "" where it does not, or the trial
        is of no network at hand."""
        try:
            planned = self.replan(trial)
        except ValueError as error:  # of an image that shows no table, say
            return f"cannot be planned again: {error}"
        return planned.differs(trial.commanded) if planned else ""

    def replan(self, trial: TrialRecording) -> Replanned | None:
        """None for a trial of another network, or none. Errors of images that cannot be planned on pass through."""
        c = trial.condition
        if c.network not in self.networks:
            return None
        kind, network = _loaded(self.networks[c.network])
        height, width = trial.depth.shape
        (fx, _, cx), (_, fy, cy) = trial.camera_matrix[:2].tolist()
        camera = Camera(width, height, (fx, fy, cx, cy), trial.distortion, self.camera.T_world_camera)
        own = view(trial.depth, camera, kind, self.table)
        scores = likeliest = np.zeros((1, *grid.SHAPE), np.float32)
        if own.inputs is not None:
            scores, likeliest = predict_both(network, own.inputs[None])
        function = GraspFunction(c.network, 0, scores[0], likeliest[0]).where_met(own.seen, self.gripper)
        scene = Scene(f"{c.object}-{c.placement}", own.seen, np.zeros(2), 0.0)
        assumed = PoseUncertainty.of(c.sigma_uv_mm, c.sigma_theta_deg)
        plans = self.planner.plans(scene, [function], [assumed])[0]
        q = next(plan.q for plan in plans if plan.method == c.method)
        robust, certain = RobustFunction(function.f, assumed), RobustFunction(function.f, CERTAIN)
        assert function.likeliest is not None
        chosen = {ROBUST: robust, LIKELIEST: RobustFunction(function.likeliest.astype(float), CERTAIN)}
        return Replanned(q, function.f, robust.on_q, chosen.get(c.method, certain), own.refused)
