"""What every method commands for one image: Centroid, and each grasp function with and without its smoothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from graspfn.evaluation.bench import Scene
from graspfn.evaluation.expected import Attempts
from graspfn.params import Plan
from graspfn.planning.centroid import centroid_grasp
from graspfn.planning.methods import BEST, CENTROID, LIKELIEST, ROBUST, best_grasp, robust_best_grasp
from graspfn.planning.smoothing import robust_function_at
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.seeds import generator

TRUE = "true function"  # the labels of the object itself: what no network can beat
UNTRAINED = -1  # the training seed of what needs no training


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
        unaware = [(function, *self._unaware(scene, function)) for function in functions]
        return [
            [centroid]
            + [
                planned
                for function, best, likeliest in unaware
                for planned in self._of_function(scene, function, best, likeliest, uncertainty)
            ]
            for uncertainty in uncertainties
        ]

    def _ties(self, scene: Scene, function: GraspFunction) -> np.random.Generator:
        return generator(self.seed, "plan", scene.name, function.network)

    def _unaware(self, scene: Scene, function: GraspFunction) -> tuple[np.ndarray | None, np.ndarray | None]:
        """What does not depend on the uncertainty: the best poses by expected score and by likeliest class."""
        best = best_grasp(function.f, self._ties(scene, function))
        if function.likeliest is None:
            return best, None
        return best, best_grasp(function.likeliest, self._ties(scene, function))

    def _of_function(
        self,
        scene: Scene,
        function: GraspFunction,
        best: np.ndarray | None,
        likeliest: np.ndarray | None,
        uncertainty: PoseUncertainty,
    ) -> list[Planned]:
        robust = robust_best_grasp(
            function.f, uncertainty.uv_m, uncertainty.theta_rad, self.plan, self._ties(scene, function)
        )
        poses = {BEST: best, ROBUST: robust}
        if function.likeliest is not None:
            poses[LIKELIEST] = likeliest
        return [
            Planned(
                method,
                function.network,
                function.training_seed,
                q if q is None or function.network != TRUE else scene.moved(q),
                promise(function.f, q, uncertainty),
            )
            for method, q in poses.items()
        ]


def promise(f: np.ndarray, q: np.ndarray | None, uncertainty: PoseUncertainty) -> float:
    """The robust score of pose q (3,) by grasp function f (33, 44, 6): the success that it leads one to expect."""
    if q is None:
        return float("nan")
    u, v, theta = q[:, None]
    return float(robust_function_at(f, uncertainty.uv_m, uncertainty.theta_rad, v, u, theta).item())
