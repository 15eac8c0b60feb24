"""Placing objects so that the gripper can take them: at rest, and at a size at which some part of each fits it.

The paper scaled its objects "to within a range of appropriate dimensions for graspable objects" (IV-C). Appropriate to
what is the gripper in use: an object fits if somewhere the open hand can stand over it and touch nothing, with a part
of the object between its fingers. A handle or a leg will do: objects that fit as a whole are best held in their middle,
where no grasp function is needed to find it (docs/benchmark.md). What is at rest is at rest at any size, so that an
object need not be dropped again at a smaller one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import trimesh
from scipy import ndimage

from graspfn.geometry.transforms import apply
from graspfn.meshes.placed import RESTING
from graspfn.params import Physics, Settle
from graspfn.physics.gripper import Kinematics
from graspfn.physics.settling import settle

DROPS = 10  # orientations that are tried
SIZES = 10  # smaller sizes that are tried in each of them
ANGLES = np.radians(np.arange(0, 180, 10))  # at which the hand is held over the object
CELL_M = 0.0025  # of the map of heights that it is held over
BESIDE_M = 0.01  # beside the pads, where a part must not grow too wide


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
    """Drop an object; where no part of it fits the gripper, draw smaller sizes, or else another orientation.

    mesh: metres about its centre of mass; smallest_m: the least that its largest extent may be.
    """
    least = min(1.0, smallest_m / float(mesh.extents.max()))
    seen = surface(mesh) if settling.fit else None
    for _ in range(DROPS):
        settled = settle(mesh, physics, settling, rng)
        if settled.status != RESTING or seen is None:
            return Placed(settled.status, settled.T_world_object)
        points = apply(settled.T_world_object, seen)
        for scale in (1.0, *rng.uniform(least, 1, SIZES)):
            if fitting_pose(points * scale, kinematics, settling.room_mm / 1e3, physics.friction) is not None:
                T = settled.T_world_object.copy()
                T[:3, 3] *= scale
                return Placed(RESTING, T, float(scale))
    return Placed(f"no part of it fits the gripper at {100 * smallest_m:g} cm or more", settled.T_world_object)


def surface(mesh: trimesh.Trimesh) -> np.ndarray:
    """Points (n, 3) of a surface, no farther apart than a cell of the map of heights."""
    points, _ = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, CELL_M, max_iter=20)
    return np.asarray(points)


def fitting_pose(points: np.ndarray, kinematics: Kinematics, room_m: float, friction: float) -> np.ndarray | None:
    """A pose (3,) (u [m], v [m], theta [rad]) at which a part of an object fits between the fingers; None if none does.

    points: (n, 3) of `surface`, on the table z = 0. Seen from above, as the hand comes: what is under an overhang
    counts as solid. The part has to be narrower than the gap by room_m, metres, half of it on either side, and must not
    grow too wide beside the pads: of the corner of a box the edges of the pads slip off.
    """
    for theta in ANGLES:
        close, across = np.array([np.cos(theta), -np.sin(theta)]), np.array([np.sin(theta), np.cos(theta)])
        turned = np.column_stack([points[:, :2] @ close, points[:, :2] @ across])
        low = turned.min(axis=0)
        fits = _fits(_heights(turned - low, points[:, 2], kinematics), kinematics, room_m, friction)
        if fits.any():
            # Of all, the one nearest to the middle of the object: the least about to turn it.
            at = (np.argwhere(fits) - _margin(kinematics) + 0.5) * CELL_M + low
            x, y = at[np.argmin(np.linalg.norm(at - turned.mean(axis=0), axis=1))]
            u, minus_v = x * close + y * across
            return np.array([u, -minus_v, theta])
    return None


def _fits(height: np.ndarray, k: Kinematics, room_m: float, friction: float) -> np.ndarray:
    """Where the hand, closing along the first axis of a map of heights (n, m), has a part between its fingers."""
    gap, lean = k.gap()
    half = (gap - room_m) / 2
    strip, wider = _across(height, k.width), _across(height, k.width + 2 * BESIDE_M)
    palm = ndimage.maximum_filter1d(_across(height, k.palm_size[1]), _cells(k.palm_size[0]), axis=0)
    apart = np.arange(_cells(2 * k.reach()) // 2 + 1) * CELL_M
    # The faces lean inwards: the higher, the less room.
    room = np.maximum((half - apart) / lean, k.clearance) if lean > 0 else np.full(len(apart), np.inf)
    most = np.where(apart <= half, room, k.clearance)
    grows = int(BESIDE_M * friction / 2 / CELL_M)
    may = (height > k.clearance) & (palm <= k.height)
    return np.asarray(_stands(may, strip, wider, most, int((half + BESIDE_M) / CELL_M), grows, k.clearance))


@numba.njit(cache=True)
def _stands(may, strip, wider, most, beside, grows, low):  # type: ignore[no-untyped-def]
    """Of the cells where the hand `may` stand, those where nothing is higher than what `most` allows so far from it.

    Within `beside` cells to either side, what is higher than `low` may reach out by `grows` more cells in the wider
    strip than in the strip.
    """
    fits = np.zeros_like(may)
    for i, j in np.argwhere(may):
        clear = True
        for side in (-1, 1):
            reach = wide = 0
            for apart in range(len(most)):
                at = i + side * apart
                clear = clear and strip[at, j] <= most[apart]
                if apart <= beside and strip[at, j] > low:
                    reach = apart
                if apart <= beside and wider[at, j] > low:
                    wide = apart
            clear = clear and wide - reach <= grows
        fits[i, j] = clear
    return fits


def _heights(xy: np.ndarray, z: np.ndarray, k: Kinematics) -> np.ndarray:
    """The highest z (n,) in each cell of the points xy (n, 2) from 0 up, with room for the hand all round."""
    cells = np.floor(xy / CELL_M).astype(int) + _margin(k)
    height = np.zeros(cells.max(axis=0) + _margin(k) + 1)
    np.maximum.at(height, tuple(cells.T), z)
    return height


def _margin(k: Kinematics) -> int:
    return _cells(2 * max(k.reach(), *k.palm_size[:2])) // 2 + 1


def _across(height: np.ndarray, width_m: float) -> np.ndarray:
    """The highest within a width across the closing direction, centred on each cell."""
    return np.asarray(ndimage.maximum_filter1d(height, _cells(width_m), axis=1))


def _cells(length_m: float) -> int:
    """The odd number of cells that covers a length."""
    return 2 * int(np.ceil(length_m / CELL_M / 2 - 0.5)) + 1
