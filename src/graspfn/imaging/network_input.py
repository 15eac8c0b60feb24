"""What a network sees of a depth image: heights above the table, at four pixels a side per cell of Q."""

from __future__ import annotations

import numpy as np

from graspfn.geometry.camera import Intrinsics
from graspfn.geometry.grid import CELL_PX, SHAPE
from graspfn.imaging.holes import check_filled

INPUT_SHAPE = (4 * SHAPE[0], 4 * SHAPE[1])  # (132, 176)
CROP_SHAPE = (CELL_PX * SHAPE[0], CELL_PX * SHAPE[1])  # (462, 616): the pixels that Q covers
UNIT_M = 0.1  # so that inputs are of order one


def crop_slices(intrinsics: Intrinsics) -> tuple[slice, slice]:
    """Rows and columns of the pixels that Q covers, centred in the image."""
    margins = []
    for key, size, taken in (
        ("height_px", intrinsics.height, CROP_SHAPE[0]),
        ("width_px", intrinsics.width, CROP_SHAPE[1]),
    ):
        if size < taken or (size - taken) % 2:
            raise ValueError(f"camera.{key}: {size} does not fit; it takes an even number of at least {taken}")
        margins.append((size - taken) // 2)
    top, left = margins
    return slice(top, top + CROP_SHAPE[0]), slice(left, left + CROP_SHAPE[1])


def area_average(crop: np.ndarray) -> np.ndarray:
    """(..., 462, 616) -> (..., 132, 176): the mean over 3.5 x 3.5 pixels.

    Two outputs span seven pixels, of which the middle one counts half to either side.
    """
    *batch, rows, columns = crop.shape
    x = crop.reshape(*batch, rows // 7, 7, columns)
    half = x[..., 3, :] * 0.5
    x = np.stack(
        [x[..., 0, :] + x[..., 1, :] + x[..., 2, :] + half, half + x[..., 4, :] + x[..., 5, :] + x[..., 6, :]], axis=-2
    ).reshape(*batch, rows * 2 // 7, columns // 7, 7)
    half = x[..., 3] * 0.5
    x = np.stack([x[..., 0] + x[..., 1] + x[..., 2] + half, half + x[..., 4] + x[..., 5] + x[..., 6]], axis=-1)
    return x.reshape(*batch, rows * 2 // 7, columns * 2 // 7) / 3.5**2


def network_input(depth: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """depth: (..., 480, 640), metres, without holes -> (..., 132, 176) float32, height above the table in 0.1 m.

    DepthError says what else a depth image is.
    """
    rows, columns = crop_slices(intrinsics)
    check_filled(depth, intrinsics)
    heights = (np.float32(intrinsics.table_depth) - depth[..., rows, columns].astype(np.float32)) / np.float32(UNIT_M)
    return area_average(heights).astype(np.float32)
