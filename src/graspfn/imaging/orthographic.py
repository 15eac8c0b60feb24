"""What lies on the table, seen straight from above without perspective: what training samples are made of."""

from __future__ import annotations

import numpy as np
import trimesh

from graspfn.geometry.grid import CELL_M, SHAPE
from graspfn.geometry.transforms import apply

FINE_M = CELL_M / 8  # 1.25 mm: two a side for each cell of a network's height map
FINE_SHAPE = (8 * SHAPE[0], 8 * SHAPE[1])  # (264, 352): the extent of Q


def render_heights(mesh: trimesh.Trimesh, T_world_object: np.ndarray) -> np.ndarray:
    """(264, 352) float32, metres over the table, of a mesh at T_world_object (4, 4): rows along v, columns along u.

    One ray through the middle of each cell, all parallel, so that the map of a moved object is the moved map.
    """
    heights = np.zeros(FINE_SHAPE)
    vertices = apply(T_world_object, mesh.vertices)
    centre = (np.array(FINE_SHAPE[::-1]) - 1) / 2
    columns_rows = vertices[:, :2] * [1, -1] / FINE_M + centre
    most = np.array(FINE_SHAPE[::-1])
    low = np.floor(columns_rows.min(axis=0)).astype(int).clip(0, most)
    high = (np.ceil(columns_rows.max(axis=0)).astype(int) + 1).clip(low, most)
    rows, columns = np.mgrid[low[1] : high[1], low[0] : high[0]]
    if not rows.size:
        return heights.astype(np.float32)
    x, y = (columns.ravel() - centre[0]) * FINE_M, (centre[1] - rows.ravel()) * FINE_M
    start = np.column_stack([x, y, np.full(x.shape, vertices[:, 2].max() + CELL_M)])
    T_object_world = np.linalg.inv(T_world_object)
    down = np.broadcast_to(T_object_world[:3, :3] @ [0, 0, -1.0], start.shape)
    triangle = mesh.ray.intersects_first(apply(T_object_world, start), down)
    hit = triangle >= 0
    # Embree works in float32: take from it which triangle, and meet that triangle's plane in float64.
    corners = vertices[mesh.faces[triangle[hit]]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = normal[:, :2] / normal[:, 2:]
    away = np.column_stack([x, y])[hit] - corners[:, 0, :2]
    z = corners[:, 0, 2] - np.sum(slope * away, axis=1)
    # A ray that grazes a triangle meets its plane anywhere, but the triangle only between its corners.
    low, high = corners[..., 2].min(axis=1), corners[..., 2].max(axis=1)
    z = np.where(np.isfinite(z), z, (low + high) / 2).clip(low, high)
    heights[rows.ravel()[hit], columns.ravel()[hit]] = z.clip(0)
    return heights.astype(np.float32)
