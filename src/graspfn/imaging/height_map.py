"""The height map: what a depth camera, whichever and wherever it is, saw of the table that Q covers.

An orthographic view: the pixels are put back into space and fall into cells of 2.5 mm. No parallax is left in it, and
what the object hides is not there, where filling a depth image smears the object over it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from graspfn.geometry.grid import CELL_M as POSE_CELL_M
from graspfn.geometry.grid import SHAPE as POSES
from graspfn.imaging.camera import NEAR_M, Camera
from graspfn.imaging.holes import BEHIND_M, check_image

FINER = 4  # cells of the map a side, per cell of Q
SHAPE = (FINER * POSES[0], FINER * POSES[1])  # (132, 176): rows along v, columns along u
CELL_M = POSE_CELL_M / FINER
# Points of one surface: four sigmas of the paper's noise. The highest of a cell's dozen of pixels alone would lie 1.6
# sigmas over the table; the mean of all that are no more than this under it lies 0.03 over it.
BAND_M = 0.006
AGREE = 0.5  # of a pixel's measured neighbours: at an edge, eq. 2 and real cameras put depths where nothing is
SUPPORT = 0.25  # of a cell has to be covered by the pixels that see a height; less is jitter at an edge
# What is lower counts as table, for networks and for Centroid: fits of a wavy table leave that much, and no gripper
# takes hold of it.
TABLE_M = 0.005


@dataclass(frozen=True, eq=False)
class HeightMap:
    """heights: (132, 176) float32, metres over the table; seen: (132, 176) bool. Where nothing is seen, 0 and False."""

    heights: np.ndarray
    seen: np.ndarray


@numba.njit
def _agreeing(depth, band, share):  # type: ignore[no-untyped-def]
    """depth (height, width), NaN for what is no measurement, or is one that most of its neighbours do not bear out."""
    height, width = depth.shape
    kept = np.full((height, width), np.nan, np.float32)
    clean = np.empty((height + 2, width + 2), np.float32)
    clean[:] = np.nan
    for row in range(height):
        for column in range(width):
            z = depth[row, column]
            clean[row + 1, column + 1] = z if (z >= NEAR_M) & (z < np.inf) else np.float32(np.nan)
    for row in range(height):
        above, here, below = clean[row], clean[row + 1], clean[row + 2]
        for column in range(width):
            z = here[column + 1]
            agree, known = np.float32(0), np.float32(0)
            for k in (column, column + 1, column + 2):
                agree += np.float32(abs(above[k] - z) <= band) + np.float32(abs(below[k] - z) <= band)
                known += np.float32(above[k] == above[k]) + np.float32(below[k] == below[k])
            for k in (column, column + 2):
                agree += np.float32(abs(here[k] - z) <= band)
                known += np.float32(here[k] == here[k])
            kept[row, column] = z if agree >= share * known else np.float32(np.nan)
    return kept


@numba.njit
def _scatter(depth, slopes, M, shape, lowest):  # type: ignore[no-untyped-def]
    """Heights of all measured pixels, sorted by cell, and where each cell's begin: (K,), (cells + 1,).

    M: (3, 4) float32, from camera axes to column, row and height.
    """
    rows, columns = shape
    n = depth.size
    cells = np.empty(n, np.int32)
    heights = np.empty(n, np.float32)
    starts = np.zeros(rows * columns + 1, np.int32)
    for i in range(n):
        z, a, b = depth[i], slopes[i, 0], slopes[i, 1]
        column = z * (M[0, 0] * a + M[0, 1] * b + M[0, 2]) + M[0, 3]
        row = z * (M[1, 0] * a + M[1, 1] * b + M[1, 2]) + M[1, 3]
        h = z * (M[2, 0] * a + M[2, 1] * b + M[2, 2]) + M[2, 3]
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns) & (h >= lowest)  # NaN is not
        cells[i] = np.int32(row) * columns + np.int32(column) if inside else rows * columns
        heights[i] = h
    for i in range(n):
        if cells[i] < rows * columns:
            starts[cells[i] + 1] += 1
    for cell in range(rows * columns):
        starts[cell + 1] += starts[cell]
    places = starts[:-1].copy()
    by_cell = np.empty(starts[-1], np.float32)
    for i in range(n):
        cell = cells[i]
        if cell < rows * columns:
            by_cell[places[cell]] = heights[i]
            places[cell] += 1
    return by_cell, starts


@numba.njit
def _highest(points, under):  # type: ignore[no-untyped-def]
    highest = np.float32(-np.inf)
    for point in points:
        highest = max(highest, point if point < under else np.float32(-np.inf))
    return highest


@numba.njit
def _height(points, highest, enough, band):  # type: ignore[no-untyped-def]
    """The mean of the highest points (n,) of a cell of which `enough` lie together, within `band`."""
    first = np.float32(np.nan)
    while highest > -np.inf:
        total, count = np.float32(0), np.float32(0)
        for point in points:
            together = np.float32((point <= highest) & (point >= highest - band))
            total += together * point
            count += together
        if count >= enough:
            return total / count
        if np.isnan(first):
            first = total / count
        highest = _highest(points, highest)
    return first  # nowhere do as many lie together: a wall, seen by few pixels


@numba.njit
def _heights(by_cell, starts, T, focal2, shape, cell_m, support, band):  # type: ignore[no-untyped-def]
    """(rows, columns) float32, NaN where a cell holds no point."""
    rows, columns = shape
    heights = np.full((rows, columns), np.nan, np.float32)
    for row in range(rows):
        dy = (rows / 2 - row - 0.5) * cell_m - T[1, 3]
        for column in range(columns):
            points = by_cell[starts[row * columns + column] : starts[row * columns + column + 1]]
            if points.size == 0:
                continue
            highest = _highest(points, np.float32(np.inf))
            dx, dz = (column - columns / 2 + 0.5) * cell_m - T[0, 3], highest - T[2, 3]
            # A pixel sees z^3 / (f^2 h) of a level surface at depth z, h under the camera.
            z = max(T[0, 2] * dx + T[1, 2] * dy + T[2, 2] * dz, NEAR_M)
            pixels = cell_m * cell_m * focal2 * -dz / (z * z * z)
            enough = min(max(support * pixels, 1.0), (points.size + 1) // 2)
            heights[row, column] = _height(points, highest, enough, np.float32(band))
    return heights


@numba.njit
def _closed(heights, band):  # type: ignore[no-untyped-def]
    """Gaps of one cell, between opposite neighbours that agree, closed: what lies between two pixels."""
    rows, columns = heights.shape
    closed = heights.copy()
    for row in range(rows):
        for column in range(columns):
            if not np.isnan(heights[row, column]):
                continue
            for dr, dc in ((0, 1), (1, 0)):
                if row - dr >= 0 and row + dr < rows and column - dc >= 0 and column + dc < columns:
                    one, other = heights[row - dr, column - dc], heights[row + dr, column + dc]
                    if abs(one - other) <= band:  # false for NaN
                        closed[row, column] = (one + other) / 2
                        break
    return closed


def height_map(depth: np.ndarray, camera: Camera) -> HeightMap:
    """depth: (height, width), metres along the optical axis; NaN, 0 and infinity say that nothing was measured.

    camera: where it stands over the table. The height of a cell is the mean of its highest points that lie together.
    DepthError says what is no image of the camera.
    """
    check_image(depth, camera)
    kept = _agreeing(np.ascontiguousarray(depth, dtype=np.float32), np.float32(BAND_M), np.float32(AGREE))
    T = np.ascontiguousarray(camera.T_world_camera, dtype=float)
    M = T[:3] * np.array([[1 / CELL_M], [-1 / CELL_M], [1]])
    M[:, 3] += SHAPE[1] / 2, SHAPE[0] / 2, 0
    slopes, lowest = camera.slopes().reshape(-1, 2), np.float32(-BEHIND_M)
    by_cell, starts = _scatter(kept.reshape(-1), slopes, M.astype(np.float32), SHAPE, lowest)
    focal2 = camera.K[0] * camera.K[1]
    heights = _closed(_heights(by_cell, starts, T, focal2, SHAPE, CELL_M, SUPPORT, BAND_M), BAND_M)
    seen = ~np.isnan(heights)
    return HeightMap(np.where(seen, heights, np.float32(0)), seen)
