"""Filling the pixels for which a depth camera gave no depth (paper IV)."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

RADIUS_PX = 5.0  # the paper's "given radius"; it gives no number


def _disc_sum(image: np.ndarray, radius: float) -> np.ndarray:
    """(height, width) sums over the disc of `radius` pixels round every pixel, nothing outside the image.

    A disc is a stack of row segments, and a segment's sum the difference of two running sums.
    """
    height, width = image.shape
    running = np.pad(np.cumsum(image, axis=1), ((0, 0), (1, 0)))
    total = np.zeros_like(running[:, 1:])
    columns = np.arange(width)
    for dy in range(-int(min(radius, height - 1)), int(min(radius, height - 1)) + 1):
        reach = int(np.sqrt(radius**2 - dy**2))
        segment = running[:, np.minimum(columns + reach + 1, width)] - running[:, np.maximum(columns - reach, 0)]
        total[max(0, -dy) : height - max(0, dy)] += segment[max(0, dy) : height - max(0, -dy)]
    return total


def fill_holes(depth: np.ndarray, radius_px: float = RADIUS_PX) -> np.ndarray:
    """depth: (height, width), metres, 0 or NaN where the camera saw nothing -> same shape, float32, without holes.

    A hole takes the average of the valid pixels within radius_px; where there are none, the nearest valid pixel.
    Valid pixels stay as they are.
    """
    valid = np.isfinite(depth) & (depth > 0)
    if valid.all():
        return depth.astype(np.float32)
    if not valid.any():
        raise ValueError("depth image: every pixel is zero or NaN; it takes at least one valid depth")
    nearest = ndimage.distance_transform_edt(~valid, return_distances=False, return_indices=True)
    filled = depth[tuple(nearest)].astype(float)
    count = _disc_sum(valid.astype(np.int64), radius_px)
    total = _disc_sum(np.where(valid, depth, 0.0).astype(float), radius_px)
    average = ~valid & (count > 0)
    filled[average] = total[average] / count[average]
    return filled.astype(np.float32)
