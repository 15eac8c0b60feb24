"""The Centroid baseline (paper VII-A): grasp the middle of what is seen, jaws across its longest direction.

The paper takes the centroid of the image. Here the pixels are first put back into space with their depth: a tall
object's top is magnified and pushed away from the image centre by perspective, and a centroid of pixels would aim
off the object for a reason that has nothing to do with the method. Seen area is then counted once per patch of the
table (as a camera at infinity would), so that sides in view do not weigh more than the top.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from graspfn.imaging.camera import Intrinsics
from graspfn.imaging.holes import check_filled

# Over the table. After a 3x3 median the paper's 1.5 mm depth noise is about 0.6 mm: eight sigmas.
HEIGHT_M = 0.005
# One object may be seen as several pieces (a handle, the legs of a chair); smaller ones than this are specks.
PIECE = 0.1
# Wider than the 0.7 mm between pixels on the table, so that a seen surface has no gaps.
PATCH_M = 0.002


def object_mask(depth: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """(480, 640) bool: pixels that stand out of the table; depth: (480, 640), metres, without holes."""
    check_filled(depth, intrinsics)
    raised = intrinsics.table_depth - ndimage.median_filter(depth, size=3) > HEIGHT_M
    pieces, _ = ndimage.label(raised, structure=np.ones((3, 3)))
    areas = np.bincount(pieces.ravel())
    areas[0] = 0
    return (areas >= max(1.0, PIECE * areas.max()))[pieces]


def seen_patches(depth: np.ndarray, mask: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """Centres (K, 2) in (u, v) [m] of the 2 mm patches of the table over which masked pixels (480, 640) see."""
    rows, columns = np.nonzero(mask)
    cx, cy = intrinsics.centre
    uv = np.stack([columns - cx, rows - cy], axis=-1) * (depth[mask] / intrinsics.focal)[:, None]
    cells = np.floor(uv / PATCH_M).astype(np.int64)
    low = cells.min(axis=0)
    occupied = np.zeros(cells.max(axis=0) - low + 1, dtype=bool)
    occupied[tuple((cells - low).T)] = True
    return (np.argwhere(occupied) + low + 0.5) * PATCH_M


def centroid_grasp(depth: np.ndarray, intrinsics: Intrinsics) -> np.ndarray | None:
    """Pose (3,) (u [m], v [m], theta [rad]), None where nothing stands out of the table; depth: (480, 640), metres.

    Raises DepthError for an image with holes, of another size or in another unit.
    """
    mask = object_mask(depth, intrinsics)
    if not mask.any():
        return None
    patches = seen_patches(depth, mask, intrinsics)
    centre = patches.mean(axis=0)
    _, directions = np.linalg.eigh((patches - centre).T @ (patches - centre))
    u, v = directions[:, 0]  # of the smallest spread: across the dominant direction
    return np.array([*centre, np.arctan2(v, u) % np.pi])
