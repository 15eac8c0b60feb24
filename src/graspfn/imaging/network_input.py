"""What a network sees: heights above the table at four pixels a side per cell of Q.

The paper's input is the depth image itself (V), which takes the paper's camera. A height map takes any camera.
"""

from __future__ import annotations

import numpy as np

from graspfn.geometry.grid import CELL_M, CELL_PX, SHAPE
from graspfn.imaging.camera import Camera
from graspfn.imaging.height_map import SHAPE as MAP_SHAPE
from graspfn.imaging.height_map import TABLE_M, HeightMap
from graspfn.imaging.holes import DepthError, check_filled

INPUT_SHAPE = MAP_SHAPE  # (132, 176): of both kinds
CROP_SHAPE = (CELL_PX * SHAPE[0], CELL_PX * SHAPE[1])  # (462, 616): the pixels that Q covers
UNIT_M = 0.1  # so that inputs are of order one


def check_papers(camera: Camera) -> None:
    """DepthError unless the camera looks straight down from where 14 px span 10 mm: what depth images as input take."""
    fx, fy, _, _ = camera.K
    middle = np.array([camera.width - 1, camera.height - 1]) / 2
    down = np.allclose(camera.T_world_camera[:3, :3], np.diag([1, -1, -1])) and np.allclose(camera.position[:2], 0)
    scale = np.array([fx, fy]) / camera.table_depth * CELL_M
    if camera.distorts or not down or not np.allclose(camera.centre, middle) or not np.allclose(scale, CELL_PX, 1e-3):
        raise DepthError(
            f"camera: {scale[0]:.4g} x {scale[1]:.4g} px span {1000 * CELL_M:g} mm at a tilt of "
            f"{np.degrees(camera.tilt):.3g} degrees; network.*.input: depth takes the paper's {CELL_PX} px, straight "
            "down over the image's centre and without distortion; height_map takes any camera"
        )


def crop_slices(camera: Camera) -> tuple[slice, slice]:
    """Rows and columns of the pixels that Q covers, centred in the paper's camera's image; else DepthError."""
    check_papers(camera)
    margins = []
    for key, size, taken in (
        ("height_px", camera.height, CROP_SHAPE[0]),
        ("width_px", camera.width, CROP_SHAPE[1]),
    ):
        if size < taken or (size - taken) % 2:
            raise DepthError(f"camera.{key}: {size} does not fit; it takes an even number of at least {taken}")
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


def depth_input(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """depth: (..., 480, 640), metres, without holes -> (..., 132, 176) float32, height above the table in 0.1 m.

    DepthError says what else a depth image is, and what camera it takes.
    """
    rows, columns = crop_slices(camera)
    check_filled(depth, camera)
    heights = (np.float32(camera.table_depth) - depth[..., rows, columns].astype(np.float32)) / np.float32(UNIT_M)
    return area_average(heights).astype(np.float32)


def height_map_input(seen: HeightMap) -> np.ndarray:
    """(2, 132, 176) float32: heights in 0.1 m, 0 where there is but table, and 1 where anything was seen."""
    standing = np.where(seen.heights < TABLE_M, np.float32(0), seen.heights)
    return np.stack([standing / np.float32(UNIT_M), seen.seen.astype(np.float32)])
