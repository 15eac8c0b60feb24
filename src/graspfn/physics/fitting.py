"""Placing objects so that the gripper can take them: at rest, between the open fingers and under the palm.

The paper scaled its objects "to within a range of appropriate dimensions for graspable objects" (IV-C). Appropriate to
what is the gripper in use: an object fits if, at some angle, it stands between the inner faces of the open fingers with
some room to spare, and under the palm. Both are linear in its size, so the largest size that fits has a closed form;
and what is at rest is at rest at any size, so an object need not be dropped again at a smaller one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import ConvexHull, QhullError

from graspfn.geometry.transforms import apply
from graspfn.meshes.placed import RESTING
from graspfn.params import Physics, Settle
from graspfn.physics.gripper import Kinematics
from graspfn.physics.settling import settle

ANGLES = np.radians(np.arange(180))  # at which the hand is held over the object
DROPS = 10  # orientations that are tried


@dataclass(frozen=True)
class Placed:
    """Where an object was placed: status, "resting" or why not; T_world_object (4, 4); and by what it was scaled."""

    status: str
    T_world_object: np.ndarray
    fit_scale: float = 1.0


def place(
    mesh: trimesh.Trimesh,
    kinematics: Kinematics,
    smallest_m: float,
    physics: Physics,
    settling: Settle,
    rng: np.random.Generator,
) -> Placed:
    """Drop an object; where it does not fit the gripper, draw a smaller size, or else another orientation.

    mesh: metres about its centre of mass; smallest_m: the least that its largest extent may be.
    """
    size = float(mesh.extents.max())
    for _ in range(DROPS):
        settled = settle(mesh, physics, settling, rng)
        if settled.status != RESTING or not settling.fit:
            return Placed(settled.status, settled.T_world_object)
        fits = largest_scale(mesh, settled.T_world_object, kinematics, settling.room_mm / 1e3)
        if fits >= 1:
            return Placed(RESTING, settled.T_world_object)
        if fits * size >= smallest_m:
            scale = rng.uniform(smallest_m / size, fits)
            T = settled.T_world_object.copy()
            T[:3, 3] *= scale
            return Placed(RESTING, T, scale)
    reason = f"too large for the gripper: it would fit at {100 * fits * size:.1f} cm, not at {100 * smallest_m:g}"
    return Placed(reason, settled.T_world_object)


def largest_scale(mesh: trimesh.Trimesh, T_world_object: np.ndarray, kinematics: Kinematics, room_m: float) -> float:
    """The factor by which an object at rest may be scaled, about the point of the table below it, and just fit.

    room_m: by how much it has to be narrower than the gap between the fingers, metres. At least 1: it fits as it is.
    """
    points = _corners(apply(T_world_object, mesh.vertices))
    gap, lean = kinematics.gap()
    across = points[:, :1] * np.cos(ANGLES) + points[:, 1:2] * np.sin(ANGLES)  # (n, angles)
    # The faces lean inwards: to stand so high is, for them, to be so much wider.
    leaning = lean * points[:, 2:]
    needed = (across + leaning).max(axis=0) + (leaning - across).max(axis=0)
    return float(min((gap - room_m) / needed.min(), kinematics.height / points[:, 2].max()))


def _corners(points: np.ndarray) -> np.ndarray:
    """Those of points (n, 3) that span their hull, or all where they are flat."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return points
