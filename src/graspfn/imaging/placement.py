"""Random placements of an object that stay in the view of the paper's camera (VII, VII-A).

Objects are placed in its view, whichever camera then looks at them: all cameras meet the same scenes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import ConvexHull

from graspfn.imaging.camera import Camera
from graspfn.imaging.orthographic import FINE_M, FINE_SHAPE

MIN_HEIGHT_M = 0.0005  # a pixel lower than this is table
PLACING = Camera.of_the_paper(640, 480, 570.0)  # it sees Q and 8 mm round it


class FlatObject(ValueError):
    """Nothing in an image stands out of the table."""


def visible_hull(depth: np.ndarray) -> np.ndarray:
    """depth: (480, 640) noise-free, metres, by PLACING -> (H, 3) float64 (u, v, depth) [m]: the hull of what is seen.

    Whether an object stays in view is decided by the largest value of a linear function over its points, which a
    vertex of their convex hull attains.
    """
    rows, columns = np.nonzero(depth < PLACING.table_depth - MIN_HEIGHT_M)
    if not len(rows):
        raise FlatObject("depth image: no object stands above the table")
    z = depth[rows, columns].astype(float)
    uv = (np.column_stack([columns, rows]) - PLACING.centre) * (z[:, None] / PLACING.K[:2])
    return _hull(np.column_stack([uv, z]))


def hull_from_above(heights: np.ndarray) -> np.ndarray:
    """heights: (264, 352) of `orthographic` -> as `visible_hull`, of what stands there."""
    rows, columns = np.nonzero(heights > MIN_HEIGHT_M)
    if not len(rows):
        raise FlatObject("height map: no object stands above the table")
    uv = (np.column_stack([columns, rows]) - (np.array(FINE_SHAPE[::-1]) - 1) / 2) * FINE_M
    return _hull(np.column_stack([uv, PLACING.table_depth - heights[rows, columns].astype(float)]))


def _hull(points: np.ndarray) -> np.ndarray:
    """Those of points (N, 3) = (u, v, depth) that are vertices of their convex hull."""
    uv = points[:, :2]
    if len(points) < 100:
        return points
    # The points' shadows on the table give a flat object's hull a volume; the points themselves leave the view first.
    # QJ: a row of pixels has no area even so.
    shadows = np.column_stack([uv, np.full(len(uv), PLACING.table_depth)])
    vertices = ConvexHull(np.concatenate([points, shadows]), qhull_options="QJ").vertices
    return points[np.unique(vertices % len(points))]


def shift_range(hull: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest shift (..., 2) in (u, v) [m] that keep an object, turned by theta (...), in view.

    hull: (H, 3) of `visible_hull`. A point at depth z is in view up to z / focal * (half the image) from the axis, so
    that a tall object has less room than its outline on the table. That it is in view as the camera sees it implies
    that it is in an image moved by `warp.move_image`. An axis with no room gives
    0 for both.
    """
    u, v, z = hull.T
    c, s = np.cos(theta)[..., None], np.sin(theta)[..., None]
    turned = np.stack([c * u - s * v, s * u + c * v], axis=-1)
    reach = z[:, None] / PLACING.K[:2] * PLACING.centre
    low, high = (-reach - turned).max(axis=-2), (reach - turned).min(axis=-2)
    room = low < high
    return np.where(room, low, 0.0), np.where(room, high, 0.0)


def random_placements(depth: np.ndarray, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Shifts (count, 2) in (u, v) [m] and angles (count,) [rad] for `T_world_scene`.

    depth: (480, 640) noise-free image by PLACING of the object in the centre. The angle is uniform on a full turn, the
    shift uniform where the whole object stays in view; along an axis where that has no room the object stays in the
    centre.
    """
    return _placements(visible_hull, depth, rng, count)


def random_placements_above(heights: np.ndarray, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """As `random_placements`, of an object whose heights (264, 352) `orthographic` drew."""
    return _placements(hull_from_above, heights, rng, count)


def _placements(
    hull_of: Callable[[np.ndarray], np.ndarray], seen: np.ndarray, rng: np.random.Generator, count: int
) -> tuple[np.ndarray, np.ndarray]:
    theta = rng.uniform(0, 2 * np.pi, count)
    try:
        hull = hull_of(seen)
    except FlatObject:  # a card: there is nothing to keep in view
        return np.zeros((count, 2)), theta
    # A hundred at a time: every angle meets every vertex, and a curved object has thousands.
    ranges = [shift_range(hull, some) for some in np.array_split(theta, -(-count // 100))]
    low, high = (np.concatenate(ends) for ends in zip(*ranges, strict=True))
    return low + rng.random((count, 2)) * (high - low), theta


def random_placement(depth: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """One of `random_placements`: shift (2,) in (u, v) [m] and angle [rad]."""
    shifts, theta = random_placements(depth, rng, 1)
    return shifts[0], float(theta[0])
