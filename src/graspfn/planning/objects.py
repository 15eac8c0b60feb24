"""What lies on the table, before anything is planned on it: one whole object, and where the gripper meets it."""

from __future__ import annotations

import cv2
import numpy as np
from scipy import ndimage

from graspfn.geometry import grid
from graspfn.imaging.camera import NEAR_M, Camera
from graspfn.imaging.height_map import CELL_M, FINER, SHAPE, TABLE_M, HeightMap
from graspfn.imaging.sight import Sight
from graspfn.params import Gripper
from graspfn.planning.centroid import object_mask

LEAST_CELLS = 16  # a square centimetre; less is a speck
# An object's highest LEAST_CELLS, in sigmas of the table around it. With all of conf/noise/sensors.yaml waves of empty
# tables reach 3.9 at most, and the flattest of the test objects, 9 mm, stands 4.6 or more out of them.
ROUGH_SIGMAS = 4.2
AROUND_M = 0.05  # what the network sees beside an object, and a hand may meet
LEAST_SEEN = 0.5  # of the cells there; with all of sensors.yaml 0.63 to 1 are seen
LARGER = 1.05  # than any object of training, heights being off by 2% and edges by a cell
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


def refusal(sight: Sight, fewest_px: float, most_m: float = np.inf) -> str:
    """Why an image is not to be planned on, in a line; empty where it is.

    fewest_px: a side that have to see a cell of the height map, for an image like those of training; most_m: the
    largest dimension that an object had there.
    """
    return _too_coarse(sight.camera, fewest_px) or _no_whole_object(sight, most_m)


def _too_coarse(camera: Camera, fewest_px: float) -> str:
    px = min(camera.K[:2]) * CELL_M / camera.table_depth
    if px >= fewest_px:
        return ""
    nearest = camera.table_depth * px / fewest_px
    return (
        f"camera: {camera.table_depth:.2f} m from the table {px:.2g} px see {1000 * CELL_M:g} mm, where the "
        f"network takes {fewest_px:g}; that is from {nearest:.2f} m and nearer"
    )


def _no_whole_object(sight: Sight, most_m: float) -> str:
    depth, camera, view, mask = sight.depth, sight.camera, sight.view, _standing_out(sight.seen)
    if mask.sum() < LEAST_CELLS:
        return "no object: nothing stands out of the table where the gripper can be sent"
    count = objects(mask)
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
    return _too_large(sight.seen, mask, most_m) or _unseen(sight.seen, mask)


def _top(seen: HeightMap) -> float:
    """Height that LEAST_CELLS reach, metres."""
    return float(np.partition(seen.heights, -LEAST_CELLS, axis=None)[-LEAST_CELLS])


def _standing_out(seen: HeightMap) -> np.ndarray:
    """(132, 176) bool: `object_mask`, without pieces that may be waves of the table."""
    mask = object_mask(seen)
    table = seen.heights[seen.seen & ~mask]
    sigma = 1.4826 * float(np.median(abs(table - np.median(table)))) if table.size else 0.0
    if _top(seen) < ROUGH_SIGMAS * sigma:
        return np.zeros_like(mask)
    pieces, count = ndimage.label(mask, structure=np.ones((3, 3)))
    tops = np.zeros(count + 1, seen.heights.dtype)
    np.maximum.at(tops, pieces[mask], seen.heights[mask])
    return (tops >= max(ROUGH_SIGMAS * sigma, TABLE_M))[pieces]


def _too_large(seen: HeightMap, mask: np.ndarray, most_m: float) -> str:
    """An object lies on the table with its largest dimension across, upright or along a diagonal."""
    across = max(cv2.minAreaRect(np.argwhere(mask).astype(np.float32))[1]) * CELL_M
    for name, size, most in (("high", _top(seen), most_m), ("long", across, np.sqrt(2) * most_m)):
        if size > LARGER * most:
            return f"the object is {100 * size:.0f} cm {name}; the network's were up to {100 * most:.0f}"
    return ""


def _unseen(seen: HeightMap, mask: np.ndarray) -> str:
    near = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5) <= AROUND_M / CELL_M
    share = float(seen.seen[near].mean())
    if share >= LEAST_SEEN:
        return ""
    return (
        f"holes: {share:.0%} of what is within {100 * AROUND_M:g} cm of the object is seen; it takes {LEAST_SEEN:.0%}"
    )


def objects(mask: np.ndarray) -> int:
    """How many of them (132, 176) bool shows."""
    _, count = ndimage.label(mask, structure=np.ones((3, 3)))
    if count > 1:
        around = ndimage.distance_transform_edt(~mask) <= APART_M / CELL_M / 2
        _, count = ndimage.label(around, structure=np.ones((3, 3)))
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
