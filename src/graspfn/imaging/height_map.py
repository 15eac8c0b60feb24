"""The height map: what a depth camera, whichever and wherever it is, saw of the table that Q covers.

An orthographic view: the pixels are put back into space and fall into cells of 2.5 mm. No parallax is left in it, and
what the object hides is not there, where filling a depth image smears the object over it.
"""

from __future__ import annotations

from dataclasses import dataclass

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
HIGHEST_M = 100.0  # far more than anything is high
# What is lower counts as table, for networks and for Centroid: fits of a wavy table leave that much, and no gripper
# takes hold of it.
TABLE_M = 0.005


@dataclass(frozen=True, eq=False)
class HeightMap:
    """heights: (132, 176) float32, metres over the table; seen: (132, 176) bool. Where nothing is seen, 0 and False."""

    heights: np.ndarray
    seen: np.ndarray


def _agreeing(depth: np.ndarray) -> np.ndarray:
    """depth (height, width), NaN for what is no measurement, or is one that most of its neighbours do not bear out."""
    height, width = depth.shape
    clean = np.full((height + 2, width + 2), np.nan, np.float32)  # all round, so that pixels are neighbours as they lie
    clean[1:-1, 1:-1] = np.where((depth >= NEAR_M) & (depth < np.inf), depth, np.float32(np.nan))
    clean = clean.ravel()
    known = (clean == clean).view(np.int8)
    agree, around = np.zeros(clean.shape, np.int8), np.zeros(clean.shape, np.int8)
    for step in (1, width + 1, width + 2, width + 3):
        one, other = slice(None, -step), slice(step, None)
        together = (np.abs(clean[other] - clean[one]) <= np.float32(BAND_M)).view(np.int8)
        agree[one] += together
        agree[other] += together
        around[one] += known[other]
        around[other] += known[one]
    kept = np.where(agree >= np.float32(AGREE) * around, clean, np.float32(np.nan))
    return kept.reshape(height + 2, width + 2)[1:-1, 1:-1]


def _points(depth: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Of the pixels over Q the cell (K,), row by row, and the height (K,) float32."""
    M = np.array(camera.T_world_camera[:3], dtype=float) * [[1 / CELL_M], [-1 / CELL_M], [1]]
    M[:, 3] += SHAPE[1] / 2, SHAPE[0] / 2, 0
    a, b = np.moveaxis(camera.slopes(), -1, 0)
    column, row, height = (depth * (m[0] * a + m[1] * b + m[2]) + m[3] for m in M.astype(np.float32))
    over = (row >= 0) & (row < SHAPE[0]) & (column >= 0) & (column < SHAPE[1])  # NaN is not
    over &= height >= np.float32(-BEHIND_M)
    return (np.floor(row[over]) * SHAPE[1] + np.floor(column[over])).astype(np.intp), height[over]


def _enough(highest: np.ndarray, points: np.ndarray, camera: Camera) -> np.ndarray:
    """Of a cell's points (132 x 176,), of which the highest is so high, how many have to lie together."""
    T = camera.T_world_camera
    column, row = np.meshgrid(*(np.arange(n) - n / 2 + 0.5 for n in SHAPE[::-1]))
    dx, dy, dz = column.ravel() * CELL_M - T[0, 3], -row.ravel() * CELL_M - T[1, 3], highest - T[2, 3]
    # A pixel sees z^3 / (f^2 h) of a level surface at depth z, h under the camera.
    z = np.maximum(T[0, 2] * dx + T[1, 2] * dy + T[2, 2] * dz, NEAR_M)
    pixels = CELL_M * CELL_M * camera.K[0] * camera.K[1] * -dz / z**3
    return np.minimum(np.maximum(SUPPORT * pixels, 1.0), (points + 1) // 2)


def _heights(cell: np.ndarray, height: np.ndarray, camera: Camera) -> np.ndarray:
    """(132, 176) float32, NaN where a cell holds no point: the mean of its highest points of which enough lie together,
    within BAND_M."""
    cells = SHAPE[0] * SHAPE[1]
    points = np.bincount(cell, minlength=cells)
    highest = np.full(cells, -np.inf, np.float32)
    np.maximum.at(highest, cell, height)
    enough = _enough(np.where(points > 0, highest, np.float32(0)), points, camera)
    lower = np.flatnonzero(height < (highest - np.float32(BAND_M))[cell])  # far fewer than the others
    count = points - np.bincount(cell[lower], minlength=cells)
    total = np.bincount(cell, height, minlength=cells) - np.bincount(cell[lower], height[lower], minlength=cells)
    heights = np.divide(total, count, out=np.full(cells, np.nan), where=count > 0)
    # The first of them may be strays over what is there. Where it is so, each point in turn, from the highest down.
    left = np.flatnonzero((count < enough)[cell])
    left = left[np.lexsort((-height[left], cell[left]))]
    cell, height = cell[left], height[left].astype(float)
    key = cell - height / HIGHEST_M  # rises from point to point, by more from cell to cell than within one
    first, last = np.arange(len(left)), np.searchsorted(key, key + BAND_M / HIGHEST_M, side="right")
    sums = np.concatenate([[0.0], np.cumsum(height)])
    together = np.flatnonzero(last - first >= enough[cell])
    settled, at = np.unique(cell[together], return_index=True)
    at = together[at]
    heights[settled] = (sums[last[at]] - sums[at]) / (last[at] - at)
    return heights.reshape(SHAPE).astype(np.float32)


def _closed(heights: np.ndarray) -> np.ndarray:
    """Gaps of one cell, between opposite neighbours that agree, closed: what lies between two pixels."""
    closed = heights.copy()
    for across in (heights, heights.T):
        one, gap, other = across[:-2], across[1:-1], across[2:]
        between = np.isnan(gap) & (np.abs(one - other) <= np.float32(BAND_M))  # false for NaN
        into = closed if across is heights else closed.T
        into[1:-1][between] = ((one + other) / 2)[between]
    return closed


def height_map(depth: np.ndarray, camera: Camera) -> HeightMap:
    """depth: (height, width), metres along the optical axis; NaN, 0 and infinity say that nothing was measured.

    camera: where it stands over the table. The height of a cell is the mean of its highest points that lie together.
    DepthError says what is no image of the camera.
    """
    check_image(depth, camera)
    kept = _agreeing(np.asarray(depth, dtype=np.float32))
    heights = _closed(_heights(*_points(kept, camera), camera))
    seen = ~np.isnan(heights)
    return HeightMap(np.where(seen, heights, np.float32(0)), seen)
