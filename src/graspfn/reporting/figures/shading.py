"""Pictures of meshes on a table by ray casting: diffuse light, one shadow, antialiased."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

Part = tuple[trimesh.Trimesh, tuple[float, float, float]]  # a mesh in world coordinates and its colour

LIGHT = np.array([-0.35, -0.55, 0.76]) / np.linalg.norm([-0.35, -0.55, 0.76])  # towards the light
AMBIENT = 0.5
TABLE = np.array([0.93, 0.92, 0.90])
OBJECT_COLOUR = (0.90, 0.58, 0.24)
GRID_M, GRID_LINE_M = 0.05, 0.0008  # thin lines on the table every 5 cm give the scale
GRID_REACH_M = 0.6
SAMPLES = 2  # rays per pixel along each side
GAP_M = 1e-4  # a shadow ray starts this far off the surface
SMOOTH_RAD = np.radians(28)  # faces that meet at less look like one curved surface


@dataclass(frozen=True)
class View:
    """A perspective camera; metres, world axes."""

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    width_m: float  # what the picture spans at the target
    width_px: int
    height_px: int

    @property
    def step_m(self) -> float:
        """From one ray to the next, at the target."""
        return self.width_m / (self.width_px * SAMPLES)

    def rays(self) -> tuple[np.ndarray, np.ndarray]:
        """Origins and unit directions (n, 3), row by row, SAMPLES x SAMPLES to a pixel."""
        eye, target = np.array(self.eye), np.array(self.target)
        forward = (target - eye) / np.linalg.norm(target - eye)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        down = np.cross(forward, right)
        columns, rows = self.width_px * SAMPLES, self.height_px * SAMPLES
        x = (np.arange(columns) + 0.5 - columns / 2) * self.step_m
        y = (np.arange(rows) + 0.5 - rows / 2) * self.step_m
        x, y = np.meshgrid(x, y)
        directions = target + x.reshape(-1, 1) * right + y.reshape(-1, 1) * down - eye
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return np.broadcast_to(eye, directions.shape), directions


def _corners(mesh: trimesh.Trimesh, pixels: int) -> tuple[trimesh.Trimesh, np.ndarray]:
    """The mesh and the normals (F, 3, 3) of its faces' corners, smooth over a curved surface.

    A mesh with more faces than the picture has pixels stays flat: nobody would see, and smoothing would take longest.
    """
    if len(mesh.faces) > pixels:
        return mesh, np.repeat(mesh.face_normals[:, None], 3, axis=1)
    smooth = trimesh.graph.smooth_shade(mesh, angle=SMOOTH_RAD)
    return smooth, smooth.vertex_normals[smooth.faces]


def _join(parts: Sequence[Part], pixels: int) -> tuple[trimesh.Trimesh, np.ndarray, np.ndarray]:
    """One mesh, the colour (F, 3) of its faces, and the normals (F, 3, 3) of its faces' corners."""
    meshes, corners = zip(*(_corners(mesh, pixels) for mesh, _ in parts), strict=True)
    colours = np.concatenate([np.tile(c, (len(m.faces), 1)) for m, (_, c) in zip(meshes, parts, strict=True)])
    normals = np.concatenate(corners)
    joined: trimesh.Trimesh = trimesh.util.concatenate(meshes)  # type: ignore[assignment]
    return joined, colours, normals


def _in_shadow(mesh: trimesh.Trimesh, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    starts = points + GAP_M * normals
    return mesh.ray.intersects_any(starts, np.tile(LIGHT, (len(points), 1)))


def _shade_mesh(
    mesh: trimesh.Trimesh,
    colours: np.ndarray,
    normals: np.ndarray,
    face: np.ndarray,
    points: np.ndarray,
    rays: np.ndarray,
) -> np.ndarray:
    """Colours (n, 3) of points (n, 3) on faces (n,) seen along rays (n, 3)."""
    weights = trimesh.triangles.points_to_barycentric(mesh.triangles[face], points, method="cross").clip(0, 1)
    normal = np.einsum("nk,nkd->nd", weights, normals[face])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-12
    normal *= -np.sign(np.sum(normal * rays, axis=1, keepdims=True))  # towards the eye: found meshes may be inside out
    lit = (normal @ LIGHT).clip(0) * ~_in_shadow(mesh, points, normal)
    return colours[face] * (AMBIENT + (1 - AMBIENT) * lit)[:, None]


def _shade_table(mesh: trimesh.Trimesh, points: np.ndarray, step_m: float) -> np.ndarray:
    """Colours (n, 3) of points (n, 3) on the table that are about step_m apart."""
    to_line = np.abs((points[:, :2] + GRID_M / 2) % GRID_M - GRID_M / 2).min(axis=1)
    # Lines fade with the distance from the world's origin, before they are finer than a pixel.
    strength = 0.14 * (1 - np.linalg.norm(points[:, :2], axis=1) / GRID_REACH_M).clip(0, 1)
    half_m = max(GRID_LINE_M, 0.6 * step_m)  # thinner lines would fall between the rays, and look like dots
    colour = TABLE * (1 - np.where(to_line < half_m, strength, 0.0))[:, None]
    shadow = _in_shadow(mesh, points, np.tile([0, 0, 1.0], (len(points), 1)))
    return colour * np.where(shadow, 0.66, 1.0)[:, None]


def render_scene(parts: Sequence[Part], view: View) -> np.ndarray:
    """(height_px, width_px, 3) float64 in [0, 1]: parts over the table z = 0, white beyond."""
    mesh, colours, normals = _join(parts, view.width_px * view.height_px)
    origins, rays = view.rays()
    picture = np.ones((len(rays), 3))
    face = mesh.ray.intersects_first(origins, rays)
    with np.errstate(divide="ignore", invalid="ignore"):
        to_table = np.where(rays[:, 2] < 0, -origins[:, 2] / rays[:, 2], np.inf)
        corner, normal = mesh.triangles[face][:, 0], mesh.face_normals[face]
        to_mesh = np.sum((corner - origins) * normal, axis=1) / np.sum(rays * normal, axis=1)
    to_mesh = np.where((face >= 0) & (to_mesh > 0), to_mesh, np.inf)
    on_mesh = np.isfinite(to_mesh) & (to_mesh <= to_table + GAP_M)
    on_table = ~on_mesh & np.isfinite(to_table)
    points = origins + np.where(on_mesh, to_mesh, np.where(on_table, to_table, 0.0))[:, None] * rays
    if on_mesh.any():
        picture[on_mesh] = _shade_mesh(mesh, colours, normals, face[on_mesh], points[on_mesh], rays[on_mesh])
    if on_table.any():
        picture[on_table] = _shade_table(mesh, points[on_table], view.step_m)
    shape = (view.height_px, SAMPLES, view.width_px, SAMPLES, 3)
    return picture.reshape(shape).mean(axis=(1, 3)).clip(0, 1)
