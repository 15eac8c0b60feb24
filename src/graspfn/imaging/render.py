"""Depth images by ray casting: the image an OpenGL depth buffer holds, without OpenGL."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh

from graspfn.geometry.camera import Intrinsics
from graspfn.geometry.transforms import apply
from graspfn.imaging.holes import NEAR_M


def _window(points_depth: np.ndarray, pixels: np.ndarray, intrinsics: Intrinsics) -> tuple[slice, slice]:
    """Rows and columns of the pixels that vertices at (V,) depths and (V, 2) pixels can cover."""
    if points_depth.min() <= NEAR_M:  # a vertex beside or behind the camera has no pixel
        return slice(0, intrinsics.height), slice(0, intrinsics.width)
    low = np.floor(pixels.min(axis=0)).astype(int).clip(0)
    high = np.ceil(pixels.max(axis=0)).astype(int) + 1
    return slice(low[1], max(high[1], low[1])), slice(low[0], max(high[0], low[0]))


def render_depth(mesh: trimesh.Trimesh, T_world_object: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """(480, 640) float32, metres along the optical axis, of a mesh at T_world_object (4, 4) on the table z = 0.

    One ray per pixel centre, cast in the object's frame, so that embree's tree serves every placement of a mesh.
    Surfaces are seen from both sides, since found meshes are not always closed.
    """
    depth = np.full((intrinsics.height, intrinsics.width), intrinsics.table_depth)
    vertices = apply(T_world_object, mesh.vertices)
    vertex_depth = intrinsics.table_depth - vertices[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = intrinsics.centre + intrinsics.focal * vertices[:, :2] * [1, -1] / vertex_depth[:, None]
    window = _window(vertex_depth, pixels, intrinsics)
    rays = intrinsics.rays()[window].reshape(-1, 3)
    if not len(rays):
        return depth.astype(np.float32)
    start = rays * NEAR_M + [0.0, 0.0, intrinsics.table_depth]
    T_object_world = np.linalg.inv(T_world_object)
    triangle = mesh.ray.intersects_first(apply(T_object_world, start), rays @ T_object_world[:3, :3].T)
    hit = triangle >= 0
    # Embree works in float32: take from it which triangle, and meet that triangle's plane in float64.
    corners = vertices[mesh.faces[triangle[hit]]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    eye = np.array([0.0, 0.0, intrinsics.table_depth])
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.sum(normal * (corners[:, 0] - eye), axis=1) / np.sum(normal * rays[hit], axis=1)
    # A ray that grazes a triangle meets its plane anywhere, but the triangle only between its corners.
    corner_depth = vertex_depth[mesh.faces[triangle[hit]]]
    along = np.where(np.isfinite(along), along, corner_depth.mean(axis=1))
    along = along.clip(corner_depth.min(axis=1), corner_depth.max(axis=1)).clip(NEAR_M)
    seen = depth[window].reshape(-1)
    seen[hit] = np.minimum(seen[hit], along)
    depth[window] = seen.reshape(depth[window].shape)
    return depth.astype(np.float32)


def renderer(name: str) -> Callable[[trimesh.Trimesh, np.ndarray, Intrinsics], np.ndarray]:
    """The function that renders depth images for `camera.renderer`: embree or opengl."""
    if name == "embree":
        return render_depth
    from graspfn.imaging.opengl import render_depth_opengl  # an optional extra

    return render_depth_opengl
