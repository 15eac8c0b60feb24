"""Attempts that provably touch nothing, found without simulating them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from graspfn.geometry.transforms import apply
from graspfn.meshes.placed import Resting
from graspfn.physics.gripper import Kinematics

HAIR_M = 1e-6  # hulls are so much larger than the object: a tip that just reaches the palm has one too


def touches_nothing(resting: Resting, q: np.ndarray, kinematics: Kinematics) -> np.ndarray:
    """Whether the hand closes and rises clear of the object at each pose; q: (m, 3) -> (m,) bool.

    Seen from above, the closing fingers stay inside one rectangle and the palm inside another, which alone the part of
    the object above the palm's underside can meet. A hand that never touches the object cannot lift it, so these
    attempts fail without being simulated.
    """
    k = kinematics
    fingers, palm = np.array([k.reach(), k.width / 2]), k.palm_size[:2] / 2
    apart = np.ones(len(q), dtype=bool)
    for half, underside in ((fingers, 0.0), (palm, k.height)):
        outline = _outline_above(resting, underside)
        if len(outline):
            apart &= _apart(outline, q, half)
    return apart


def _outline_above(resting: Resting, height: float) -> np.ndarray:
    """(n, 2) counter-clockwise corners of the hull, seen from above, of what a gripper touches above `height` metres.

    No corners where nothing is so high.
    """
    points = apply(resting.T_world_object, resting.collision.vertices)
    above = points[:, 2] > height
    if not above.any():
        return np.empty((0, 2))
    edges = resting.collision.edges_unique
    one, other = points[edges[above[edges[:, 0]] != above[edges[:, 1]]].T]
    cut = one + (other - one) * (height - one[:, 2:]) / (other - one)[:, 2:]
    diamond = HAIR_M * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    corners = (np.concatenate([points[above], cut])[:, None, :2] + diamond).reshape(-1, 2)
    return corners[ConvexHull(corners).vertices]


def _apart(hull: np.ndarray, q: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Whether each pose's rectangle of half sizes `half` (2,) is clear of the polygon `hull` (n, 2); (m, 3) -> (m,).

    Two convex shapes are apart exactly when an edge normal of either separates them.
    """
    middle = (hull.min(axis=0) + hull.max(axis=0)) / 2
    radius = np.linalg.norm(hull - middle, axis=1).max() + np.linalg.norm(half)
    centre = np.stack([q[:, 0], -q[:, 1]], axis=-1)
    apart = np.linalg.norm(centre - middle, axis=1) > radius
    near = np.flatnonzero(~apart)  # the rest is far away
    centre, theta = centre[near], q[near, 2]
    close = np.stack([np.cos(theta), -np.sin(theta)], axis=-1)  # the hand's x axis in the world
    across = np.stack([-close[:, 1], close[:, 0]], axis=-1)
    clear = np.zeros(len(near), dtype=bool)
    for axis, extent in ((close, half[0]), (across, half[1])):
        along = axis @ hull.T - np.sum(axis * centre, axis=-1, keepdims=True)
        clear |= (along.min(axis=1) > extent) | (along.max(axis=1) < -extent)
    edges = np.roll(hull, -1, axis=0) - hull
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=-1)
    for normal, corner in zip(normals, hull, strict=True):  # outward, since ConvexHull runs counter-clockwise
        nearest = (centre - corner) @ normal - half[0] * np.abs(close @ normal) - half[1] * np.abs(across @ normal)
        clear |= nearest > 0
    apart[near] = clear
    return apart
