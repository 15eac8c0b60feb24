"""The Centroid baseline (paper VII-A): grasp the middle of what is seen, jaws across its longest direction.

The paper takes the centroid of the image. Here it is that of the height map: in an image a tall object's top is
magnified and pushed away from the centre by perspective, and a centroid of pixels would aim off the object for a reason
that has nothing to do with the method. Seen area counts once per cell of the table (as a camera at infinity would), so
that sides in view do not weigh more than the top.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from graspfn.imaging.height_map import CELL_M, SHAPE, TABLE_M, HeightMap

# One object may be seen as several pieces (a handle, the legs of a chair); smaller ones than this are specks.
PIECE = 0.1


def object_mask(seen: HeightMap) -> np.ndarray:
    """(132, 176) bool: cells that stand out of the table."""
    pieces, _ = ndimage.label(seen.heights >= TABLE_M, structure=np.ones((3, 3)))
    areas = np.bincount(pieces.ravel())
    areas[0] = 0
    return (areas >= max(1.0, PIECE * areas.max()))[pieces]


def centroid_grasp(seen: HeightMap) -> np.ndarray | None:
    """Pose (3,) (u [m], v [m], theta [rad]), None where nothing stands out of the table."""
    mask = object_mask(seen)
    if not mask.any():
        return None
    rows, columns = np.nonzero(mask)
    cells = (np.stack([columns, rows], axis=-1) - (np.array(SHAPE[::-1]) - 1) / 2) * CELL_M
    centre = cells.mean(axis=0)
    _, directions = np.linalg.eigh((cells - centre).T @ (cells - centre))
    u, v = directions[:, 0]  # of the smallest spread: across the dominant direction
    return np.array([*centre, np.arctan2(v, u) % np.pi])
