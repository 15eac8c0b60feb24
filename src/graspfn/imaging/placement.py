"""Random placements of an object that stay in the camera's view (paper VII, VII-A)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import ConvexHull

from graspfn.imaging.camera import Camera
from graspfn.imaging.orthographic import FINE_M, FINE_SHAPE

MIN_HEIGHT_M = 0.0005  # a pixel lower than this is table
# Test objects are placed in its view, whichever camera then looks at them: all cameras meet the same scenes.
PLACING = Camera.of_the_paper(640, 480, 570.0)
VIEW_M = PLACING.table_depth / PLACING.K[0] * PLACING.centre  # of the table, either way from the middle: Q and 8 mm


class FlatObject(ValueError):
    """Nothing in an image stands out of the table."""


def visible_hull(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """depth: (480, 640) noise-free, metres -> (H, 3) float64 (u, v, depth) [m]: vertices of the hull of what is seen.

    Whether an object stays in view is decided by the largest value of a linear function over its points, which a
    vertex of their convex hull attains.
    """
    rows, columns = np.nonzero(depth < camera.table_depth - MIN_HEIGHT_M)
    if not len(rows):
        raise FlatObject("depth image: no object stands above the table")
    z = depth[rows, columns].astype(float)
    uv = (np.column_stack([columns, rows]) - camera.centre) * (z[:, None] / camera.K[:2])
    points = np.column_stack([uv, z])
    return _hull(points, camera)


def hull_from_above(heights: np.ndarray) -> np.ndarray:
    """heights: (264, 352) of `orthographic` -> as `visible_hull`, of what stands there, seen by PLACING."""
    rows, columns = np.nonzero(heights > MIN_HEIGHT_M)
    if not len(rows):
        raise FlatObject("height map: no object stands above the table")
    uv = (np.column_stack([columns, rows]) - (np.array(FINE_SHAPE[::-1]) - 1) / 2) * FINE_M
    return _hull(np.column_stack([uv, PLACING.table_depth - heights[rows, columns].astype(float)]), PLACING)


def _hull(points: np.ndarray, camera: Camera) -> np.ndarray:
    """Those of points (N, 3) = (u, v, depth) that are vertices of their convex hull."""
    uv = points[:, :2]
    if len(points) < 100:
        return points
    # The points' shadows on the table give a flat object's hull a volume; the points themselves leave the view first.
    # QJ: a row of pixels has no area even so.
    shadows = np.column_stack([uv, np.full(len(uv), camera.table_depth)])
    vertices = ConvexHull(np.concatenate([points, shadows]), qhull_options="QJ").vertices
    return points[np.unique(vertices % len(points))]


def shift_range(hull: np.ndarray, theta: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest shift (..., 2) in (u, v) [m] that keep an object, turned by theta (...), in view.

    hull: (H, 3) of `visible_hull`. A point at depth z is in view up to z / focal * (half the image) from the axis, so
    that a tall object has less room than its outline on the table. That it is in view as the camera sees it implies
    that it is in an image moved by `warp.move_image`. A camera that sees more of the table than the paper's gives no
    more room than that one. An axis with no room gives 0 for both.
    """
    u, v, z = hull.T
    c, s = np.cos(theta)[..., None], np.sin(theta)[..., None]
    turned = np.stack([c * u - s * v, s * u + c * v], axis=-1)
    sides = camera.centre, [camera.width - 1, camera.height - 1] - camera.centre
    before, after = (np.minimum(z[:, None] / camera.K[:2] * side, VIEW_M) for side in sides)
    low, high = (-before - turned).max(axis=-2), (after - turned).min(axis=-2)
    room = low < high
    return np.where(room, low, 0.0), np.where(room, high, 0.0)


def random_placements(
    depth: np.ndarray, camera: Camera, rng: np.random.Generator, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Shifts (count, 2) in (u, v) [m] and angles (count,) [rad] for `T_world_scene`.

    depth: (height, width) noise-free image of the object in the centre, by a camera that looks straight down. The angle
    is uniform on a full turn, the shift uniform where the whole object stays in view; along an axis where that has no
    room the object stays in the centre.
    """
    return _placements(lambda: visible_hull(depth, camera), camera, rng, count)


def random_placements_above(heights: np.ndarray, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """As `random_placements` in the view of PLACING, of an object whose heights (264, 352) `orthographic` drew."""
    return _placements(lambda: hull_from_above(heights), PLACING, rng, count)


def _placements(
    hull_of: Callable[[], np.ndarray], camera: Camera, rng: np.random.Generator, count: int
) -> tuple[np.ndarray, np.ndarray]:
    theta = rng.uniform(0, 2 * np.pi, count)
    try:
        hull = hull_of()
    except FlatObject:  # a card: there is nothing to keep in view
        return np.zeros((count, 2)), theta
    # A hundred at a time: every angle meets every vertex, and a curved object has thousands.
    ranges = [shift_range(hull, some, camera) for some in np.array_split(theta, -(-count // 100))]
    low, high = (np.concatenate(ends) for ends in zip(*ranges, strict=True))
    return low + rng.random((count, 2)) * (high - low), theta


def random_placement(depth: np.ndarray, camera: Camera, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """One of `random_placements`: shift (2,) in (u, v) [m] and angle [rad]."""
    shifts, theta = random_placements(depth, camera, rng, 1)
    return shifts[0], float(theta[0])
