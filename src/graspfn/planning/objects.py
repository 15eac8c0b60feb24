"""What lies on the table, before anything is planned on it: one whole object, and where the gripper meets it."""

from __future__ import annotations

import cv2
import numpy as np
from scipy import ndimage

from graspfn.geometry import grid
from graspfn.imaging.camera import NEAR_M, Camera
from graspfn.imaging.height_map import CELL_M, FINER, SHAPE, HeightMap
from graspfn.imaging.sight import Sight
from graspfn.params import Gripper
from graspfn.planning.centroid import object_mask

LEAST_CELLS = 16  # a square centimetre; less is a speck
# Pieces no further apart are one object's, the legs of a chair: no finger goes between them without touching one. The
# test objects' pieces are up to 21 mm apart.
APART_M = 0.03
# Parts of an object beyond an edge: points that stand so high, so close to what is seen of it. A table wavy by 2 mm rms
# reaches 8 mm.
STANDING_M, NEAR_OBJECT_M = 0.01, 0.02
CUT_M = 0.015  # along the edge of the view; an object that just touches it is whole
FEW_POINTS = 5  # beyond Q
BESIDE_M = 0.01  # beyond Q: up to there the training objects reach as well, which are placed in the paper's view
EVERY_PX = 4
HALF_M = np.array(SHAPE[::-1]) * CELL_M / 2  # of Q's extent along u and v


def refusal(sight: Sight, fewest_px: float) -> str:
    """Why an image is not to be planned on, in a line; empty where it is.

    fewest_px: a side that have to see a cell of the height map, for an image like those of training.
    """
    return _too_coarse(sight.camera, fewest_px) or _no_whole_object(sight)


def _too_coarse(camera: Camera, fewest_px: float) -> str:
    px = min(camera.K[:2]) * CELL_M / camera.table_depth
    if px >= fewest_px:
        return ""
    nearest = camera.table_depth * px / fewest_px
    return (
        f"camera: {camera.table_depth:.2f} m from the table {px:.2g} px see {1000 * CELL_M:g} mm, where the "
        f"network takes {fewest_px:g}; that is from {nearest:.2f} m and nearer"
    )


def _no_whole_object(sight: Sight) -> str:
    depth, camera, view, mask = sight.depth, sight.camera, sight.view, object_mask(sight.seen)
    if mask.sum() < LEAST_CELLS:
        return "no object: nothing stands out of the table where the gripper can be sent"
    count = objects(mask, sight.seen.heights)
    if count > 1:
        return f"several objects: {count} that stand more than {1000 * APART_M:g} mm apart; it takes one"
    cut = _standing_near(mask, _on_edge(depth, view), depth, camera)
    if cut * camera.table_depth / camera.K[0] > CUT_M:
        return "the object leaves the view"
    if mask[:2].any() or mask[-2:].any() or mask[:, :2].any() or mask[:, -2:].any():
        beside = np.zeros(depth.shape, dtype=bool)
        beside[::EVERY_PX, ::EVERY_PX] = True if view is None else view[::EVERY_PX, ::EVERY_PX]
        if _standing_near(mask, beside, depth, camera, beyond=BESIDE_M) >= FEW_POINTS:
            width, height = 200 * HALF_M
            return f"the object leaves the {width:g} x {height:g} cm of the table that grasps are planned on"
    return ""


def objects(mask: np.ndarray, heights: np.ndarray) -> int:
    """How many of them (132, 176) bool shows; beside one, what stands no higher than STANDING_M is a wave of the table.

    heights: (132, 176), metres.
    """
    _, count = ndimage.label(mask, structure=np.ones((3, 3)))
    if count > 1:
        around = ndimage.distance_transform_edt(~mask) <= APART_M / CELL_M / 2
        pieces, count = ndimage.label(around, structure=np.ones((3, 3)))
        highest = ndimage.maximum(heights, pieces, np.arange(1, count + 1))
        count = max(1, np.count_nonzero(highest > STANDING_M))
    return int(count)


def _on_edge(depth: np.ndarray, view: np.ndarray | None) -> np.ndarray:
    """(height, width) bool: the outermost pixels of the view."""
    if view is None:
        edge = np.ones(depth.shape, dtype=bool)
        edge[1:-1, 1:-1] = False
        return edge
    square = np.ones((3, 3), np.uint8)
    inside = cv2.erode(view.astype(np.uint8), square, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return view & (inside == 0)


def _standing_near(
    mask: np.ndarray, pixels: np.ndarray, depth: np.ndarray, camera: Camera, beyond: float | None = None
) -> int:
    """How many of the pixels (height, width) see something that stands near the object, and so far beyond Q."""
    z = depth[pixels].astype(float)
    points = np.column_stack([camera.slopes()[pixels] * z[:, None], z])
    points = points @ camera.T_world_camera[:3, :3].T + camera.position
    uv = points[:, :2] * [1, -1]
    standing = (z >= NEAR_M) & np.isfinite(z) & (points[:, 2] > STANDING_M)
    if beyond is not None:
        standing &= (np.abs(uv) > HALF_M + beyond).any(axis=1)
        standing &= (np.abs(uv) < HALF_M + beyond + NEAR_OBJECT_M).all(axis=1)
    near = NEAR_OBJECT_M + (beyond or 0.0)
    margin = int(near / CELL_M) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * margin + 1, 2 * margin + 1))
    around = cv2.dilate(np.pad(mask.astype(np.uint8), margin), disc)
    columns, rows = np.floor((uv[standing] + HALF_M) / CELL_M).astype(int).T + margin
    inside = (rows >= 0) & (rows < around.shape[0]) & (columns >= 0) & (columns < around.shape[1])
    return int(around[rows[inside], columns[inside]].sum())


def where_met(scores: np.ndarray, seen: HeightMap, gripper: Gripper) -> np.ndarray:
    """scores (33, 44, 6), 0 wherever the open gripper has nothing of the object between its fingers."""
    return np.where(meets(object_mask(seen), gripper), scores, 0)


def meets(mask: np.ndarray, gripper: Gripper) -> np.ndarray:
    """(33, 44, 6) bool: the poses at which what is seen of the object, (132, 176) bool, lies between the open fingers.

    To the cell: a part of the object in a pose's cell, or between the fingers sent anywhere in it.
    """
    n_v, n_u, n_theta = grid.SHAPE
    cells = mask.reshape(n_v, FINER, n_u, FINER).max(axis=(1, 3)).astype(np.uint8)
    along = gripper.opening_mm / 2000 + grid.CELL_M
    across = gripper.finger_width_mm / 2000 + grid.CELL_M
    reach = int(np.ceil(np.hypot(along, across) / grid.CELL_M))
    step = np.arange(-reach, reach + 1)
    v, u = np.meshgrid(step * grid.CELL_M, step * grid.CELL_M, indexing="ij")
    met = np.zeros(grid.SHAPE, dtype=bool)
    for k in range(n_theta):
        c, s = np.cos(k * grid.CELL_RAD), np.sin(k * grid.CELL_RAD)
        between = (np.abs(c * u + s * v) <= along) & (np.abs(c * v - s * u) <= across)
        # The same all round: a pose meets a cell as that cell meets the pose.
        met[:, :, k] = cv2.dilate(cells, between.astype(np.uint8)) > 0
    return met
