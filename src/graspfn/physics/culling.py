"""Attempts that provably touch nothing, found without simulating them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from graspfn.physics.gripper import Kinematics


def touches_nothing(footprint: np.ndarray, q: np.ndarray, kinematics: Kinematics) -> np.ndarray:
    """Whether the fingers sweep clear of the object at each pose.

    footprint: (n, 2) world x, y of the object's vertices, metres; q: (m, 3) poses -> (m,) bool.
    The whole closing stays inside a rectangle of the table plane, and the object inside the convex hull of its
    footprint: two convex shapes are apart exactly when an edge normal of either separates them. Fingers that never
    touch the object cannot lift it, so these attempts fail without being simulated.
    """
    hull = footprint[ConvexHull(footprint).vertices]
    half = np.array([kinematics.reach(), kinematics.width / 2])
    centre = np.stack([q[:, 0], -q[:, 1]], axis=-1)
    close = np.stack([np.cos(q[:, 2]), -np.sin(q[:, 2])], axis=-1)  # the hand's x axis in the world
    across = np.stack([-close[:, 1], close[:, 0]], axis=-1)
    apart = np.zeros(len(q), dtype=bool)
    for axis, extent in ((close, half[0]), (across, half[1])):
        along = axis @ hull.T - np.sum(axis * centre, axis=-1, keepdims=True)
        apart |= (along.min(axis=1) > extent) | (along.max(axis=1) < -extent)
    edges = np.roll(hull, -1, axis=0) - hull
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=-1)
    for normal, corner in zip(normals, hull, strict=True):  # outward, since ConvexHull runs counter-clockwise
        nearest = (centre - corner) @ normal - half[0] * np.abs(close @ normal) - half[1] * np.abs(across @ normal)
        apart |= nearest > 0
    return apart
