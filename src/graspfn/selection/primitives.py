"""Solids that household objects are made of: revolved profiles, hollow vessels, rods, slabs.

All are manifold3d solids, so that every union and difference of them is closed by construction. z points up and
lengths are relative to an object of about unit size.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import trimesh
from manifold3d import CrossSection, JoinType, Manifold
from scipy.interpolate import PchipInterpolator

from graspfn.meshes.errors import RejectedMeshError

SEGMENTS = 24  # sides of a full circle: round enough in a 132 x 176 image, cheap enough for collision detection
Point = Sequence[float] | np.ndarray
Points = Sequence[Point] | np.ndarray


def to_trimesh(solid: Manifold) -> trimesh.Trimesh:
    """The surface of a solid; RejectedMeshError where it is in pieces, as one generated object in a thousand is."""
    # booleans of nearly coincident surfaces leave needles; as_original forgets which part a face came from, which
    # would keep the seams between parts from being simplified
    solid = solid.as_original().simplify(1e-3)
    if len(solid.decompose()) != 1:
        raise RejectedMeshError("its parts do not touch")
    mesh = solid.to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts.astype(np.int64), process=False)


def unite(parts: Sequence[Manifold]) -> Manifold:
    """Union of all parts."""
    total = Manifold()
    for part in parts:
        total += part
    return total


def box(size: Point, centre: Point = (0, 0, 0)) -> Manifold:
    """Box of (x, y, z) edge lengths about its centre."""
    return Manifold.cube(tuple(size), True).translate(tuple(centre))


def disc(radius: float, height: float, base: Point = (0, 0, 0), top_radius: float | None = None) -> Manifold:
    """Upright cylinder, or cone where top_radius differs, standing on `base`."""
    top = radius if top_radius is None else top_radius
    return Manifold.cylinder(height, radius, top, SEGMENTS).translate(tuple(base))


def ball(radii: Point, centre: Point = (0, 0, 0), sides: int = 12) -> Manifold:
    """Ellipsoid with the given half axes."""
    return Manifold.sphere(1.0, sides).scale(tuple(radii)).translate(tuple(centre))


def rod(points: Points, radii: float | Sequence[float] | np.ndarray, sides: int = 8) -> Manifold:
    """Tube of round section swept along points (n, 3), with rounded ends and joints; one radius or one per point."""
    thickness = np.broadcast_to(np.asarray(radii, dtype=float), len(points))
    joints = [ball((r, r, r), point, sides) for point, r in zip(points, thickness, strict=True)]
    return unite([Manifold.batch_hull([a, b]) for a, b in itertools.pairwise(joints)])


def ring(radius: float, tube: float, centre: Point = (0, 0, 0), sides: int = 8) -> Manifold:
    """Torus lying flat."""
    return CrossSection.circle(tube, sides).translate((radius, 0)).revolve(SEGMENTS).translate(tuple(centre))


def outline(points: Points, rounding: float = 0.0) -> CrossSection:
    """Plane polygon through points (n, 2), its convex corners rounded."""
    section = CrossSection([np.asarray(points, dtype=float)])
    if rounding:
        inner = section.offset(-rounding, JoinType.Miter)
        section = inner.offset(rounding, JoinType.Round, circular_segments=SEGMENTS // 2)
    return section


def rectangle(width: float, depth: float, rounding: float = 0.0) -> CrossSection:
    """Rectangle about the origin, its corners rounded."""
    x, y = width / 2, depth / 2
    return outline([(-x, -y), (x, -y), (x, y), (-x, y)], rounding)


def slab(section: CrossSection, height: float, base: Point = (0, 0, 0), scale_top: Point = (1, 1)) -> Manifold:
    """A plane section raised by `height` above `base`, growing or shrinking towards the top by scale_top (x, y)."""
    return section.extrude(height, scale_top=tuple(scale_top)).translate(tuple(base))


def profile(heights: Sequence[float], radii: Sequence[float], samples: int = 10) -> np.ndarray:
    """Smooth curve (samples, 2) of (radius, height) through the given points, without overshoot."""
    z = np.linspace(heights[0], heights[-1], samples)
    return np.column_stack([PchipInterpolator(heights, radii)(z), z])


def revolve(curve: np.ndarray, sides: int = SEGMENTS) -> Manifold:
    """Solid of revolution about z under a curve (n, 2) of (radius, height) with heights ascending."""
    return outline(_both_sides(curve)).revolve(sides)


def cavity(curve: np.ndarray, wall: float, sides: int = SEGMENTS) -> Manifold:
    """What to cut out of `revolve(curve)` to leave an open vessel whose wall and floor are `wall` thick."""
    above = np.vstack([curve, curve[-1] + [0.0, 2 * wall]])  # carries the cut out through the rim
    inside = outline(_both_sides(above)).offset(-wall, JoinType.Miter).simplify(wall / 20)
    return inside.revolve(sides)


def _both_sides(curve: np.ndarray) -> np.ndarray:
    """A closed outline (2n, 2) that mirrors the curve in the axis, so that an offset leaves the axis alone."""
    return np.vstack([curve, curve[::-1] * [-1.0, 1.0]])
