"""Finding the table in a depth image: the pose of a camera is never known as well as the image shows the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from graspfn.imaging.camera import NEAR_M, Camera
from graspfn.params import Table

DRAWS = 256  # planes through three points: with two in ten pixels on the table, one in eight hundred images misses it
SPARSE, DENSE = 1000, 20000  # points that planes are compared on, and that the best is refined on
NEAR_PLANE_M = 0.008  # points of a plane, while planes are compared
# Points so far under a plane show that it is an object's top and not the table; what is lower is the floor beside it.
UNDER_M = (0.02, 0.3)
BANDS_M = (0.015, 0.008)  # of the first refinements; then by the spread of the points
LEAST_BAND_M, MOST_BAND_M = 0.002, 0.015
FEWEST = 100  # points


class TableError(ValueError):
    """A depth image in which there is no table to plan on: one line that says why."""


@dataclass(frozen=True, eq=False)
class TableFit:
    """Where the camera stands over the table that it sees.

    T_world_camera: (4, 4). x, y and yaw of the pose that was given are kept, height and tilt are those of the plane.
    tilt_deg: of the optical axis against the table's normal. height_m: of the lens over the table.
    inliers: share of what is measured that is table. rms_m: of those points about the plane.
    """

    T_world_camera: np.ndarray
    tilt_deg: float
    height_m: float
    inliers: float
    rms_m: float


def _points(depth: np.ndarray, slopes: np.ndarray, step: int) -> np.ndarray:
    """(3, K) float32 points in camera axes, of the measured among every step-th pixel of every step-th row."""
    z, slopes = depth[::step, ::step], slopes[::step, ::step]
    measured = (z >= NEAR_M) & (z < np.inf)
    z, slopes = z[measured], slopes[measured]
    return np.stack([z * slopes[:, 0], z * slopes[:, 1], z])


def _along(n: np.ndarray, points: np.ndarray) -> np.ndarray:
    """n x of points (3, K), n (3,) or (3, D, 1); term by term: products of matrices round as the machine does."""
    return n[0] * points[0] + n[1] * points[1] + n[2] * points[2]


def _best_plane(points: np.ndarray, planes: np.ndarray) -> np.ndarray | None:
    """Of planes (D, 4) float32 the one with most table on it; None where none has any. points: (3, K) float32.

    A point counts as the square of its depth, the area that its pixel covers; one under the plane counts against it.
    """
    above = _along(planes.T[:3, :, None], points) - planes[:, 3, None]
    near, under, deep = (np.float32(m) for m in (NEAR_PLANE_M, *UNDER_M))
    counts = (np.abs(above) < near).astype(np.float32) - ((above < -under) & (above > -deep))
    scores = np.sum(counts * points[2] ** 2, axis=1)
    return planes[scores.argmax()] if scores.max(initial=0) > 0 else None


def _moments(points: np.ndarray, T: np.ndarray, band: float) -> np.ndarray:
    """Sums over the points within `band` of the plane z = 0 of frame T (4, 4): of 1, x, y, h, xx, xy, yy, xh, yh, hh.

    Then the number and the sum of hh of those at most MOST_BAND_M under it, where no object is: the table's spread.
    """
    h = _along(T[2, :3], points) + T[2, 3]
    near, under = np.flatnonzero(np.abs(h) <= band), h[(h < 0) & (h >= -MOST_BAND_M)]
    h, points = h[near], points.take(near, axis=1)
    x, y = _along(T[0, :3], points), _along(T[1, :3], points)
    summed = (x, y, h, x * x, x * y, y * y, x * h, y * h, h * h)
    return np.array([h.size, *(np.sum(each) for each in summed), under.size, np.sum(under * under)])


def _planes(points: np.ndarray) -> np.ndarray:
    """(D, 4) float32 n, d of planes n x = d, n towards the camera, each through three of the points (3, K)."""
    a, b, c = points.T[np.random.default_rng(0).integers(points.shape[1], size=(3, DRAWS))].astype(float)
    n = np.cross(b - a, c - a)
    length = np.linalg.norm(n, axis=1)
    n = n[length > 1e-6] / np.where(n[:, 2] > 0, -length, length)[length > 1e-6, None]  # no triangle under 1 mm x 2 mm
    d = np.sum(n * a[length > 1e-6], axis=1)
    return np.column_stack([n, d])[d < 0].astype(np.float32)  # the camera is over the table


def _turn_to_z(n: np.ndarray) -> np.ndarray:
    """(3, 3) smallest turn that takes the unit vector n to z."""
    x, y, z = n
    if z < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    return np.array(
        [[1 - x * x / (1 + z), -x * y / (1 + z), -x], [-x * y / (1 + z), 1 - y * y / (1 + z), -y], [x, y, z]]
    )


def _refined(points: np.ndarray, plane: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Normal and offset (4,) of the least-squares plane in a narrowing band, the share of points in it, their rms."""
    T = np.eye(4)
    n, points = plane[:3].astype(float), points.astype(float)
    T[:3, :3], T[2, 3] = _turn_to_z(n / np.linalg.norm(n)), -plane[3]
    band, rounds = BANDS_M[0], (*BANDS_M[1:], None, None, None)
    for following in rounds:
        sums = _moments(points, T, band)
        if sums[0] < FEWEST:
            break
        one, x, y, h, xx, xy, yy, xh, yh = sums[:9]
        a, b, c = np.linalg.solve([[xx, xy, x], [xy, yy, y], [x, y, one]], [xh, yh, h])
        length = np.sqrt(1 + a * a + b * b)
        step = np.eye(4)
        step[:3, :3], step[2, 3] = _turn_to_z(np.array([-a, -b, 1.0]) / length), -c / length
        T = step @ T
        spread = np.sqrt(sums[11] / max(sums[10], 1))
        band = following or float(np.clip(3 * spread, LEAST_BAND_M, MOST_BAND_M))
    sums = _moments(points, T, band)
    return np.append(T[2, :3], -T[2, 3]), float(sums[0] / points.shape[1]), float(np.sqrt(sums[9] / max(sums[0], 1)))


def find_plane(depth: np.ndarray, camera: Camera, offset_m: float) -> tuple[np.ndarray, float, float]:
    """The table in an image (height, width), metres: n, d (4,) of n x = d in camera axes, n towards the camera, then
    the share of points on it and their rms, metres. TableError where there is none.

    A plane that is no more than offset_m from where the camera's pose has the table goes before all others.
    """
    image = np.ascontiguousarray(depth, dtype=np.float32)
    points = _points(image, camera.slopes(), max(1, int(np.sqrt(image.size / DENSE))))
    count = points.shape[1]
    if count < FEWEST:
        raise TableError(f"depth image: {count} of the pixels looked at hold a depth; a table takes {FEWEST}")
    sparse = np.ascontiguousarray(points[:, :: max(1, count // SPARSE)])
    planes = _planes(sparse)
    expected = np.abs(planes[:, 3] + camera.position[2]) <= offset_m
    for some in (planes[expected], planes[~expected]):
        plane = _best_plane(sparse, some)
        if plane is not None:
            return _refined(points, plane)
    raise TableError("depth image: no plane in it that could be a table")


def fit_table(depth: np.ndarray, camera: Camera, limits: Table) -> TableFit:
    """depth: (height, width), metres; NaN, 0 and infinity say that nothing was measured.

    camera: as far as it is known; only x, y and yaw of its pose are believed. TableError names the limit that is not
    kept.
    """
    plane, inliers, rms = find_plane(depth, camera, limits.max_offset_mm / 1000)
    tilt = float(np.degrees(np.arctan2(np.hypot(*plane[:2]), -plane[2])))
    if tilt > limits.max_tilt_deg:
        raise TableError(
            f"table: {tilt:.1f} degrees from under the camera; table.max_tilt_deg takes {limits.max_tilt_deg:g}"
        )
    if inliers < limits.min_inliers:
        raise TableError(f"table: {inliers:.0%} of what is measured; table.min_inliers takes {limits.min_inliers:.0%}")
    if 1000 * rms > limits.max_rms_mm:
        raise TableError(f"table: {1000 * rms:.1f} mm rms rough; table.max_rms_mm takes {limits.max_rms_mm:g}")
    given = camera.T_world_camera
    offset = float(given[2, 3] + plane[3])
    if 1000 * abs(offset) > limits.max_offset_mm:
        raise TableError(
            f"table: {-plane[3]:.3f} m under the camera, which is said to be at {given[2, 3]:.3f} m; "
            f"table.max_offset_mm takes {limits.max_offset_mm:g}"
        )
    T = given.copy()
    T[:3, :3] = _turn_to_z(given[:3, :3] @ plane[:3]) @ given[:3, :3]
    T[2, 3] = -plane[3]
    return TableFit(T, tilt, -float(plane[3]), inliers, rms)
