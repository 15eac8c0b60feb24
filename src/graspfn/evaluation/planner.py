"""What every method commands for one image: Centroid, and each grasp function with and without its smoothing.

The steps are those of `planning/planner.py`, which takes one image to one pose; here one image goes to the poses of all
methods under many uncertainties, with functions that may be predicted already.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from graspfn.evaluation.bench import Scene
from graspfn.evaluation.expected import Attempts
from graspfn.imaging.camera import Camera
from graspfn.imaging.height_map import SHAPE, HeightMap
from graspfn.imaging.sight import look
from graspfn.imaging.table import TableError
from graspfn.params import Gripper, Plan, Table
from graspfn.planning.centroid import centroid_grasp
from graspfn.planning.methods import BEST, CENTROID, LIKELIEST, ROBUST, best_grasp, robust_best_grasp
from graspfn.planning.model import FEWEST_PX
from graspfn.planning.objects import refusal, where_met
from graspfn.planning.robust import RobustFunction
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.seeds import generator

TRUE = "true function"  # the labels of the object itself: what no network can beat
UNTRAINED = -1  # the training seed of what needs no training
NOTHING = HeightMap(np.zeros(SHAPE, np.float32), np.zeros(SHAPE, bool))


@dataclass(frozen=True, eq=False)
class View:
    """An image as it is planned on.

    refused: why it is not, in a line; "" where it is. seen: NOTHING where it is refused, so that no method finds a
    grasp. inputs: (channels, 132, 176) of the network that looks, None where no table was found.
    """

    inputs: np.ndarray | None
    seen: HeightMap
    refused: str


def view(depth: np.ndarray, camera: Camera, kind: str, table: Table) -> View:
    """depth: (height, width), metres, as the camera gives it; kind: `network.*.input` of the network that looks.

    DepthError where it is no image of the camera, or does not look like one.
    """
    try:
        sight = look(depth, camera, kind, table)
    except TableError as error:
        return View(None, NOTHING, str(error))
    refused = refusal(sight, FEWEST_PX)
    return View(sight.inputs, NOTHING if refused else sight.seen, refused)


@dataclass(frozen=True, eq=False)
class GraspFunction:
    """A grasp function to plan with, and whose it is: a network's, or the TRUE one.

    f: (33, 44, 6) scores at the poses of Q; likeliest: the same, but the class with the largest output, as the paper
    scores (V), or None. The true function is about the object as it was labelled, not about the image.
    """

    network: str
    training_seed: int
    f: np.ndarray
    likeliest: np.ndarray | None = None

    def where_met(self, seen: HeightMap, gripper: Gripper) -> GraspFunction:
        """The same as planners take a network's: 0 where the gripper does not meet what is seen of the object."""
        likeliest = None if self.likeliest is None else where_met(self.likeliest, seen, gripper)
        return GraspFunction(self.network, self.training_seed, where_met(self.f, seen, gripper), likeliest)


def true_function(attempts: Attempts) -> GraspFunction:
    """The grasp function that the labels of an object are."""
    return GraspFunction(TRUE, UNTRAINED, attempts.held.mean(axis=-1))


@dataclass(frozen=True, eq=False)
class Planned:
    """A commanded pose (3,) of the image, None where the method found no grasp, and what planned it.

    network is "" for Centroid; promise: the robust score of the pose by the function that planned it, NaN for Centroid.
    """

    method: str
    network: str
    training_seed: int
    q: np.ndarray | None
    promise: float = float("nan")


@dataclass(frozen=True)
class Planner:
    """Plans with every method. Ties are drawn by (seed, name of the scene)."""

    plan: Plan
    seed: int

    def plans(
        self, scene: Scene, functions: Sequence[GraspFunction], uncertainties: Sequence[PoseUncertainty]
    ) -> list[list[Planned]]:
        """The poses of all methods under each uncertainty."""
        centroid = Planned(CENTROID, "", UNTRAINED, centroid_grasp(scene.seen))
        planned = [[centroid] for _ in uncertainties]
        for function in functions:
            whose = scene.name, function.network
            unaware = {BEST: self._best(function.f, *whose)}
            if function.likeliest is not None:
                unaware[LIKELIEST] = self._best(function.likeliest, *whose)
            for of_cell, uncertainty in zip(planned, uncertainties, strict=True):
                robust = RobustFunction(function.f, uncertainty)
                poses = unaware | {ROBUST: robust_best_grasp(robust, self.plan, self._ties(*whose))}
                promises = promises_of(robust, list(poses.values()))
                for (method, q), promise in zip(poses.items(), promises, strict=True):
                    commanded = scene.moved(q) if q is not None and function.network == TRUE else q
                    of_cell.append(Planned(method, function.network, function.training_seed, commanded, promise))
        return planned

    def _best(self, f: np.ndarray, scene: str, network: str) -> np.ndarray | None:
        return best_grasp(f, self._ties(scene, network))

    def _ties(self, scene: str, network: str) -> np.random.Generator:
        return generator(self.seed, "plan", scene, network)


def promises_of(function: RobustFunction, poses: Sequence[np.ndarray | None]) -> list[float]:
    """The robust scores of poses (3,): the success that they lead one to expect; NaN for None."""
    found = [q for q in poses if q is not None]
    promises = iter(function.at(np.stack(found)).tolist() if found else [])
    return [float("nan") if q is None else next(promises) for q in poses]
