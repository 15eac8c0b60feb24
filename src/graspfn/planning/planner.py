"""From a user's own depth image to the pose to command: table, height map, network, Sigma (paper VI).

Frames: q = (u, v, theta) lies on the table that is found in the image. The grasp's frame has its origin between the
fingertips, x closes the jaws, z points up from the table. With P the grasp, R the robot's base, G its gripper when the
image was taken, C the camera and I the table as the image shows it: T_RP = T_RG T_GC T_CI p.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from graspfn.geometry.transforms import T_world_grasp, apply
from graspfn.imaging.camera import Camera
from graspfn.imaging.height_map import HeightMap
from graspfn.imaging.holes import check_image
from graspfn.imaging.sight import Sight, look
from graspfn.imaging.table import TableError, TableFit
from graspfn.learning.folder import read_config, read_network
from graspfn.params import Gripper, Plan, Table, build
from graspfn.planning.centroid import centroid_grasp
from graspfn.planning.methods import best_grasp, robust_best_grasp
from graspfn.planning.model import DEFAULT, FEWEST_PX, check_model, largest_object_m
from graspfn.planning.objects import refusal, where_met
from graspfn.planning.onnx_network import OnnxNetwork
from graspfn.planning.robust import RobustFunction
from graspfn.planning.target import T_robot_target
from graspfn.planning.uncertainty import PlanningError, PoseUncertainty


class Method(str, enum.Enum):
    """How a pose is chosen (paper VII-A)."""

    ROBUST = "robust"
    BEST = "best"
    CENTROID = "centroid"

    __str__ = str.__str__  # Python 3.10 has no StrEnum


class Predictor(Protocol):
    """A network: input (channels, 132, 176) float32 -> scores (33, 44, 6) in [0, 1], and the likeliest classes
    (33, 44, 6), 0 to 5. Called from several threads at once."""

    def __call__(self, inputs: np.ndarray, /) -> tuple[np.ndarray, np.ndarray]: ...


@dataclass(frozen=True, eq=False)
class Grasp:
    """A pose to command, and what it was planned on.

    q: (3,) (u [m], v [m], theta [rad]) on the table, from the world's origin; z_m: of the fingertips over the table.
    pixel: (3,) (x [px], y [px], theta [rad]) in the image, of the point between the fingertips and of their closing.
    T_camera_grasp, T_robot_grasp: (4, 4); the second where the robot's frames were given.
    score: the grasp function at q; robust_score: with the errors of the arm, the success that the pose promises.
    function: the grasp function `f` that was planned on and its robust one, `on_q`, both (33, 44, 6).
    seen: the height map; camera: where it stands over the table; table: what its fit found, None where the camera's
    pose was believed.
    """

    method: Method
    q: np.ndarray
    z_m: float
    pixel: np.ndarray
    T_camera_grasp: np.ndarray
    T_robot_grasp: np.ndarray | None
    score: float
    robust_score: float
    function: RobustFunction
    seen: HeightMap
    camera: Camera
    table: TableFit | None


@dataclass(frozen=True, eq=False)
class NoGrasp:
    """No pose to command, with the reason in a line; table: what its fit found, where it found one."""

    reason: str
    table: TableFit | None = None


@dataclass(frozen=True, eq=False)
class GraspPlanner:
    """Plans on depth images. It holds nothing that changes: the same image gives the same grasp, from any thread.

    input: `network.*.input` of the network behind `predict`. gripper, table, refinement: as gripper, table and plan in
    params.yaml. fewest_px: a side that have to see a cell of the height map, for an image like those of training.
    most_m: the largest dimension that an object had there.
    """

    predict: Predictor
    input: str
    gripper: Gripper
    table: Table
    refinement: Plan
    fewest_px: float = FEWEST_PX
    most_m: float = np.inf

    @classmethod
    def load(
        cls,
        model: Path = DEFAULT,
        gripper: Gripper | None = None,
        table: Table | None = None,
        plan: Plan | None = None,
        threads: int = 1,
    ) -> GraspPlanner:
        """With the network in a model's folder, and what its config.json says of the rest unless it is given here.

        threads: that the network takes for an image. A folder of data/networks will do where gripper, table and plan
        are given; torch runs it. WeightsError, ModelError or ParameterError, in one line that names the file, where the
        folder is none.
        """
        config = read_config(model)
        exported = "format" in config or gripper is None or table is None or plan is None
        if exported:
            check_model(config, model)
        gripper = gripper or build(Gripper, config.get("gripper"), f"{model}/config.json: gripper")
        table = table or build(Table, config.get("table"), f"{model}/config.json: table")
        plan = plan or build(Plan, config.get("plan"), f"{model}/config.json: plan")
        fewest_px = config.get("camera", {}).get("fewest_px", FEWEST_PX)
        network = read_network(model)
        predict: Predictor
        if exported:
            predict = OnnxNetwork(model, network.channels, config["onnx_sha256"], threads)
        else:
            from graspfn.learning.prediction import OneByOne  # torch, which planning with a model does without
            from graspfn.learning.weights import load_network

            predict = OneByOne(load_network(model))
        return cls(predict, network.input, gripper, table, plan, fewest_px, largest_object_m(config, model))

    def plan(
        self,
        depth: np.ndarray,
        camera: Camera,
        uncertainty: PoseUncertainty,
        method: Method | str = Method.ROBUST,
        *,
        posed: bool = True,
        roi: tuple[int, int, int, int] | None = None,
        mask: np.ndarray | None = None,
        T_robot_gripper: np.ndarray | None = None,
        T_gripper_camera: np.ndarray | None = None,
        min_score: float = 0.0,
    ) -> Grasp | NoGrasp:
        """depth: (height, width), metres along the optical axis; NaN, 0 and infinity say that nothing was measured.

        posed: whether the camera's pose is known, as far as `fit_table` needs it. Otherwise the world's origin is where
        the optical axis meets the table, and u the image's x on it.
        roi: (x, y, width, height), px, and mask, (height, width) bool: the pixels that count; beside them the table is
        taken for empty, and it is found in all pixels. min_score: what a pose has to promise.
        Raises DepthError, PlanningError: what was given is no image of this camera, mask, or rigid transform.
        """
        method = Method(method)
        check_image(depth, camera)
        view = _view(depth.shape, roi, mask)
        if self.input == "depth" and not posed:
            raise PlanningError("camera: its pose is unknown; a network with input: depth takes the paper's")
        T_robot_camera = _product(T_robot_gripper, T_gripper_camera)
        try:
            sight = look(depth, camera, self.input, self.table, posed=posed, view=view)
        except TableError as error:
            return NoGrasp(str(error))
        if why := refusal(sight, self.fewest_px, self.most_m):
            return NoGrasp(why, sight.table)
        scores, _ = self.predict(sight.inputs)
        function = RobustFunction(where_met(scores, sight.seen, self.gripper), uncertainty)
        q = self._pose(method, function, sight.seen)
        if q is None:
            return NoGrasp("score: no pose has one above 0", sight.table)
        grasp = self._grasp(method, q, function, sight, T_robot_camera)
        if grasp.robust_score < min_score:
            why = f"score: {grasp.robust_score:.3f} at best; min_score takes {min_score:g}"
            return NoGrasp(why, sight.table)
        return grasp

    def _pose(self, method: Method, function: RobustFunction, seen: HeightMap) -> np.ndarray | None:
        if method is Method.CENTROID:
            return centroid_grasp(seen)
        return best_grasp(function.f) if method is Method.BEST else robust_best_grasp(function, self.refinement)

    def _grasp(
        self, method: Method, q: np.ndarray, function: RobustFunction, sight: Sight, T_robot_camera: np.ndarray | None
    ) -> Grasp:
        z_m = self.gripper.clearance_mm / 1000
        T_camera_table, here = np.linalg.inv(sight.camera.T_world_camera), np.eye(4)
        T_robot_grasp = None
        if T_robot_camera is not None:
            T_robot_grasp = T_robot_target(T_robot_camera, here, T_camera_table, q, z_m)
        return Grasp(
            method=method,
            q=q,
            z_m=z_m,
            pixel=_pixel(q, z_m, sight.camera),
            T_camera_grasp=T_robot_target(here, here, T_camera_table, q, z_m),
            T_robot_grasp=T_robot_grasp,
            score=float(RobustFunction(function.f, CERTAIN).at(q[None]).item()),
            robust_score=float(function.at(q[None]).item()),
            function=function,
            seen=sight.seen,
            camera=sight.camera,
            table=sight.table,
        )


CERTAIN = PoseUncertainty((0.0, 0.0))
FURTHEST_M = 1e6  # of one of a robot's frames from another; NaN is further


def _pixel(q: np.ndarray, z_m: float, camera: Camera) -> np.ndarray:
    """(3,) (x, y [px], theta [rad]) of a grasp as the camera sees it; a millimetre either way gives its direction."""
    closing = np.array([[0, 0, z_m], [-0.001, 0, z_m], [0.001, 0, z_m]])
    (x, y), before, after = camera.project(apply(T_world_grasp(q), closing))[:, :2]
    dx, dy = after - before
    return np.array([x, y, np.arctan2(dy, dx) % np.pi])


def _view(shape: tuple[int, ...], roi: tuple[int, int, int, int] | None, mask: np.ndarray | None) -> np.ndarray | None:
    """(height, width) bool: the pixels that count; None for all."""
    if roi is None and mask is None:
        return None
    view = np.ones(shape, dtype=bool)
    if mask is not None:
        if mask.shape != shape:
            raise PlanningError(f"mask: has the shape {mask.shape}; it takes that of the image, {shape}")
        view &= mask.astype(bool)
    if roi is not None:
        x, y, width, height = roi
        if not (0 <= x < x + width <= shape[1] and 0 <= y < y + height <= shape[0]):
            raise PlanningError(f"roi: {roi} is not within the image; it takes (x, y, width, height), px")
        inside = np.zeros(shape, dtype=bool)
        inside[y : y + height, x : x + width] = True
        view &= inside
    if not view.any():
        raise PlanningError("mask: no pixel is left; it takes those that may show the object")
    return view


def _product(T_robot_gripper: np.ndarray | None, T_gripper_camera: np.ndarray | None) -> np.ndarray | None:
    """T_robot_camera (4, 4), None where neither is given; PlanningError where one is missing or is not rigid."""
    given = {"T_robot_gripper": T_robot_gripper, "T_gripper_camera": T_gripper_camera}
    if all(T is None for T in given.values()):
        return None
    product = np.eye(4)
    for name, T in given.items():
        if T is None:
            raise PlanningError(f"{name}: missing; it takes both frames or neither")
        product = product @ check_rigid(T, name)
    return product


def check_rigid(T: np.ndarray, name: str) -> np.ndarray:
    """(4, 4) float64, if T is a rigid transform; PlanningError if it is none."""
    matrix = np.asarray(T, dtype=float)
    rigid = matrix.shape == (4, 4) and bool((abs(matrix) <= FURTHEST_M).all()) and np.allclose(matrix[3], [0, 0, 0, 1])
    turn = matrix[:3, :3] if rigid else np.zeros((3, 3))
    if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-4) or np.linalg.det(turn) < 0:
        raise PlanningError(f"{name}: takes a rigid transform, 4 x 4")
    return matrix
