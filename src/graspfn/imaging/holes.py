"""The pixels for which a depth camera gave no depth, and filling them (paper VI)."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from graspfn.imaging.camera import NEAR_M, Camera

RADIUS_PX = 5.0  # the paper's "given radius"; it gives no number

# Nothing is behind the table. A real one is seen some way off where it should be: the noise of eq. 2 (33 sigmas), a
# table or a camera out of level (5 degrees are 2 cm at the image's edge), a height that was measured by hand.
BEHIND_M = 0.05


class DepthError(ValueError):
    """A depth image that cannot be planned on: one line that says why."""


def holes(depth: np.ndarray, camera: Camera | None) -> np.ndarray:
    """(...) bool: pixels of depth (...), metres, that hold no depth.

    They are zero, negative, NaN or infinite, or no point that this camera can see: nearer than NEAR_M or BEHIND_M
    behind the table, as the codes are by which drivers say that they measured nothing. camera: None where nobody
    knows how high over the table the camera was.
    """
    nothing = ~(np.isfinite(depth) & (depth > 0))
    if camera is not None:
        nothing |= (depth < NEAR_M) | (depth > camera.bare_table() + BEHIND_M)
    return nothing


def check_image(depth: np.ndarray, camera: Camera | None) -> None:
    """DepthError unless depth (..., height, width) are numbers that can be metres, of the camera's size."""
    if depth.dtype.kind != "f":
        raise DepthError(f"depth image: is of {depth.dtype}; it takes metres, as floating-point numbers")
    if depth.ndim < 2 or 0 in depth.shape:
        raise DepthError(f"depth image: has the shape {depth.shape}; it takes (height, width)")
    height, width = depth.shape[-2:]
    if camera is not None and (height, width) != (camera.height, camera.width):
        raise DepthError(f"depth image: is {width}x{height} pixels; the camera's are {camera.width}x{camera.height}")


def check_filled(depth: np.ndarray, camera: Camera) -> None:
    """DepthError unless depth (..., height, width) is an image of the camera without a hole."""
    check_image(depth, camera)
    count = int(holes(depth, camera).sum())
    if count:
        raise DepthError(f"depth image: {count} of its {depth.size} pixels hold no depth; fill_holes fills them")


def _disc_sums(image: np.ndarray, rows: np.ndarray, columns: np.ndarray, radius: float) -> np.ndarray:
    """(K,) sums of image (height, width) over the discs of `radius` pixels round K pixels, nothing outside the image.

    A disc is a stack of row segments, and a segment's sum the difference of two running sums.
    """
    height, width = image.shape
    running = np.pad(np.cumsum(image, axis=1), ((0, 0), (1, 0)))
    total = np.zeros(len(rows), dtype=running.dtype)
    most = int(min(radius, height - 1))
    for dy in range(-most, most + 1):
        reach = int(np.sqrt(radius**2 - dy**2))
        row = (rows + dy).clip(0, height - 1)
        segment = running[row, np.minimum(columns + reach + 1, width)] - running[row, np.maximum(columns - reach, 0)]
        total += np.where(row == rows + dy, segment, 0)
    return total


def fill_holes(depth: np.ndarray, camera: Camera | None, radius_px: float = RADIUS_PX) -> np.ndarray:
    """depth: (height, width), metres, as a camera gives it -> same shape, float32, without `holes`.

    A hole takes the average of the valid pixels within radius_px; where there are none, the nearest valid pixel.
    Valid pixels stay as they are. Raises DepthError where no pixel is valid, or where most lie behind the table: that
    is another unit or another camera, and the table itself would be filled in from what stands on it.
    """
    check_image(depth, camera)
    hole = holes(depth, camera)
    if camera is not None:
        behind = float(np.mean(np.isfinite(depth) & (depth > camera.bare_table() + BEHIND_M)))
        if behind > 0.5:
            raise DepthError(
                f"depth image: {behind:.0%} of it lies behind the table, which is {camera.table_depth:.3f} m from "
                "the camera; it takes metres, from the camera of the parameters"
            )
    if hole.all():
        raise DepthError("depth image: no pixel holds a depth; it takes at least one")
    filled = np.where(hole, 0, depth).astype(np.float32)
    rows, columns = np.nonzero(hole)
    count = _disc_sums((~hole).astype(np.int64), rows, columns, radius_px)
    near = count > 0
    total = _disc_sums(np.where(hole, 0.0, depth).astype(float), rows[near], columns[near], radius_px)
    filled[rows[near], columns[near]] = total / count[near]
    if not near.all():
        nearest = ndimage.distance_transform_edt(hole, return_distances=False, return_indices=True)
        far = rows[~near], columns[~near]
        filled[far] = depth[nearest[0][far], nearest[1][far]]
    return filled
