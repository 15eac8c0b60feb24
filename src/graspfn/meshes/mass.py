"""The mass, centre and inertia of an object of uniform density (paper IV-A, 'object density')."""

from __future__ import annotations

import numpy as np
import trimesh

VOLUME, HULL = "volume", "convex hull"  # what carries the mass of an object
ROUNDING = 1e-6  # of the largest moment of inertia, which no two others of a body may fall short of
MIN_SOLID = 1e-6  # closed volume over hull volume, below which the surface encloses only rounding errors


def solid(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The closed surface that carries the mass of a mesh: the mesh itself, or its convex hull where it is open, or
    where so much of it is inside out that no body could have its mass."""
    hull = mesh.convex_hull
    closed = mesh.is_watertight and mesh.is_winding_consistent
    return mesh if closed and signed_volume(mesh) > MIN_SOLID * hull.volume and _can_be(mesh) else hull


def _can_be(mesh: trimesh.Trimesh) -> bool:
    """Whether a body could have the centre of mass and the inertia of a closed mesh; DART would fling any other."""
    centred = mesh.vertices - mesh.bounds.mean(axis=0)
    body = trimesh.Trimesh(centred, mesh.faces, process=False)
    least, middle, most = np.linalg.eigvalsh(body.moment_inertia)
    inside = (np.abs(body.center_mass) <= np.ptp(centred, axis=0) / 2).all()
    return bool(inside and least > 0 and least + middle > (1 - ROUNDING) * most)


def mass_properties(mesh: trimesh.Trimesh, density: float) -> tuple[float, np.ndarray]:
    """Mass (kg) and inertia (3, 3) (kg m^2) about the centre of mass, along the mesh's axes.

    mesh: metres; density: kg/m^3, uniform inside the surface, or inside the convex hull of an open one.
    """
    body = solid(mesh)
    centred = body.vertices - body.center_mass  # far from the origin the volume integrals cancel badly
    body = trimesh.Trimesh(centred, body.faces, process=False)
    return float(body.volume * density), np.asarray(body.moment_inertia) * density


def signed_volume(mesh: trimesh.Trimesh) -> float:
    """Volume of a closed mesh, negative where it is inside out; trimesh would also divide by it."""
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
