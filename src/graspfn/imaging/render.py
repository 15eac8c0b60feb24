"""Depth images by ray casting: the image an OpenGL depth buffer holds, without OpenGL."""

from __future__ import annotations

import numpy as np
import trimesh

from graspfn.geometry.transforms import apply
from graspfn.imaging.camera import NEAR_M, Camera


def _window(vertices: np.ndarray, camera: Camera) -> tuple[slice, slice]:
    """Rows and columns of the pixels that vertices, (V, 3) of pixel and depth, can cover."""
    # A vertex beside or behind the camera has no pixel, and between its ends an edge seen through a lens may bulge.
    if camera.distorts or vertices[:, 2].min() <= NEAR_M:
        return slice(0, camera.height), slice(0, camera.width)
    low = np.floor(vertices[:, :2].min(axis=0)).astype(int).clip(0)
    high = np.ceil(vertices[:, :2].max(axis=0)).astype(int) + 1
    return slice(low[1], max(high[1], low[1])), slice(low[0], max(high[0], low[0]))


def render_depth(mesh: trimesh.Trimesh, T_world_object: np.ndarray, camera: Camera) -> np.ndarray:
    """(height, width) float32, metres along the optical axis, of a mesh at T_world_object (4, 4) on the table z = 0.

    One ray per pixel centre, through the lens, cast in the object's frame, so that embree's tree serves every placement
    of a mesh. Surfaces are seen from both sides, since found meshes are not always closed. Past the horizon it is inf.
    """
    depth = camera.bare_table()
    vertices = apply(T_world_object, mesh.vertices)
    seen = camera.project(vertices)
    window = _window(seen, camera)
    rays = camera.rays()[window].reshape(-1, 3)
    if not len(rays):
        return depth.astype(np.float32)
    start = rays * NEAR_M + camera.position
    T_object_world = np.linalg.inv(T_world_object)
    triangle = mesh.ray.intersects_first(apply(T_object_world, start), rays @ T_object_world[:3, :3].T)
    hit = triangle >= 0
    # Embree works in float32: take from it which triangle, and meet that triangle's plane in float64.
    corners = vertices[mesh.faces[triangle[hit]]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.sum(normal * (corners[:, 0] - camera.position), axis=1) / np.sum(normal * rays[hit], axis=1)
    # A ray that grazes a triangle meets its plane anywhere, but the triangle only between its corners.
    corner_depth = seen[mesh.faces[triangle[hit]], 2]
    along = np.where(np.isfinite(along), along, corner_depth.mean(axis=1))
    along = along.clip(corner_depth.min(axis=1), corner_depth.max(axis=1)).clip(NEAR_M)
    nearest = depth[window].reshape(-1)
    nearest[hit] = np.minimum(nearest[hit], along)
    depth[window] = nearest.reshape(depth[window].shape)
    return depth.astype(np.float32)
