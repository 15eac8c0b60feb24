"""Simulated trials of Table 1 (paper V-A): plan on a noisy image, miss the pose by the uncertainty, grasp in DART."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from graspfn.geometry.camera import Intrinsics
from graspfn.geometry.transforms import unmove_pose
from graspfn.meshes.placed import Resting
from graspfn.params import Plan
from graspfn.physics.attempt import Grasper, Result
from graspfn.physics.world import Rig
from graspfn.planning.centroid import centroid_grasp
from graspfn.planning.methods import best_grasp, robust_best_grasp
from graspfn.workflow.seeds import generator

NO_GRASP = "no grasp"  # outcome of a trial without a pose to try: a failure
NOWHERE = np.full(3, np.nan)


@dataclass(frozen=True)
class Sigma:
    """The gripper's pose uncertainty, diag(sigma_uv^2, sigma_uv^2, sigma_theta^2), in people's units."""

    uv_mm: float
    theta_deg: float

    @property
    def uv_m(self) -> float:
        return self.uv_mm / 1e3

    @property
    def theta_rad(self) -> float:
        return float(np.radians(self.theta_deg))

    def reached(self, q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """A draw of the pose (3,) that the gripper reaches when sent to q: N(q, Sigma), theta wrapped to [0, pi)."""
        reached = q + rng.standard_normal(3) * [self.uv_m, self.uv_m, self.theta_rad]
        reached[2] %= np.pi
        return reached


@dataclass(frozen=True)
class Planned:
    """A commanded pose (3,), None where the method found no grasp, and what planned it; network is "" for Centroid."""

    method: str
    network: str
    q: np.ndarray | None


def plan_all(
    depth: np.ndarray,
    functions: Mapping[str, np.ndarray],
    sigmas: Sequence[Sigma],
    plan: Plan,
    intrinsics: Intrinsics,
    seed: int,
    name: str,
) -> list[tuple[Sigma, Planned]]:
    """The pose of every method for one image under every uncertainty.

    depth: (480, 640) as the camera gives it, holes filled; functions: (33, 44, 6) per network. Ties are drawn by
    (seed, name).
    """
    unaware = [Planned("Centroid", "", centroid_grasp(depth, intrinsics))]
    for network, f in functions.items():
        unaware.append(Planned("Best Grasp", network, best_grasp(f, generator(seed, "plan", name, network))))
    plans = []
    for sigma in sigmas:
        plans += [(sigma, planned) for planned in unaware]
        for network, f in functions.items():
            rng = generator(seed, "plan", name, network)
            q = robust_best_grasp(f, sigma.uv_m, sigma.theta_rad, plan, rng)
            plans.append((sigma, Planned("Robust Best Grasp", network, q)))
    return plans


class Bench:
    """One object of known placement to try grasps on.

    The object stays in the middle of the world where it was settled, and poses are moved to it instead: the physics
    of a grasp does not depend on where on the table it happens.
    """

    def __init__(self, resting: Resting, rig: Rig):
        self.grasper = Grasper(resting, rig)

    def grasp(self, q: np.ndarray, shift_uv: np.ndarray, theta: float, film: bool = False) -> Result:
        """Attempt pose q (3,) of the image in which the object was turned by theta, then shifted by (u, v) metres."""
        return self.grasper.run(unmove_pose(q, shift_uv, theta), film=film)


def trials_of_object(
    name: str,
    bench: Bench,
    depth: np.ndarray,
    shift_uv: np.ndarray,
    theta: float,
    functions: Mapping[str, np.ndarray],
    sigmas: Sequence[Sigma],
    plan: Plan,
    intrinsics: Intrinsics,
    seed: int,
) -> list[dict[str, Any]]:
    """One trial per method and uncertainty. The methods of a cell share the gripper's error, and so are paired.

    A method that finds no grasp fails: outcome NO_GRASP, and NaN for the poses.
    """
    rows = []
    for sigma, planned in plan_all(depth, functions, sigmas, plan, intrinsics, seed, name):
        commanded, reached, held, outcome = NOWHERE, NOWHERE, False, NO_GRASP
        if planned.q is not None:
            commanded = planned.q
            reached = sigma.reached(planned.q, generator(seed, "evaluate", name, sigma.uv_mm, sigma.theta_deg))
            result = bench.grasp(reached, shift_uv, theta)
            held, outcome = result.held, result.outcome.value
        rows.append(
            {
                "id": name,
                "method": planned.method,
                "network": planned.network,
                "sigma_uv_mm": sigma.uv_mm,
                "sigma_theta_deg": sigma.theta_deg,
                **dict(zip(("u_m", "v_m", "theta_rad"), commanded.tolist(), strict=True)),
                **dict(zip(("reached_u_m", "reached_v_m", "reached_theta_rad"), reached.tolist(), strict=True)),
                "success": held,
                "outcome": outcome,
            }
        )
    return rows
