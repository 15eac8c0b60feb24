"""The mass, centre and inertia of an object of uniform density (paper IV-A, 'object density')."""

from __future__ import annotations

import numpy as np
import trimesh

VOLUME, HULL = "volume", "convex hull"  # what carries the mass of an object
MIN_SOLID = 1e-6  # closed volume over hull volume, below which the surface encloses only rounding errors


def solid(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The closed surface that carries the mass of a mesh: the mesh itself, or its convex hull where it is open."""
    hull = mesh.convex_hull
    closed = mesh.is_watertight and mesh.is_winding_consistent
    return mesh if closed and signed_volume(mesh) > MIN_SOLID * hull.volume else hull


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
