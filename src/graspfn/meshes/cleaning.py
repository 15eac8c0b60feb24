"""Making a mesh fit for physics: repairs, and the mass it has (paper III-A, 'object density')."""

from __future__ import annotations

import hashlib

import numpy as np
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from graspfn.meshes.errors import RejectedMeshError

CLOSED, REPAIRED, HULL_MASS = "closed", "repaired", "hull mass"
MIN_FACES = 4  # a tetrahedron
MIN_FILL = 1e-6  # hull volume over the cube of the largest extent, below which a mesh is a sheet or a line
MIN_SOLID = 1e-3  # closed volume over hull volume, below which the surface encloses only rounding errors


def clean(raw: trimesh.Trimesh) -> tuple[trimesh.Trimesh, str]:
    """A repaired copy of a mesh in its own units, without colours or normals, and what was needed.

    Holes of three or four edges are filled, windings made to agree and to point outwards.

    "closed": it bounded a volume as it was; "repaired": it does now; "hull mass": it does not, so that its mass,
    centre and inertia are those of its convex hull, while its surface stays. Raises RejectedMeshError with the reason.
    """
    _check(np.asarray(raw.vertices), np.asarray(raw.faces))
    mesh = _welded(raw.vertices, raw.faces)
    _check(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    if _hull_volume(mesh) <= MIN_FILL * mesh.extents.max() ** 3:
        raise RejectedMeshError("no volume: all of it lies in one plane or line")
    whole = mesh.is_watertight
    if not whole:
        trimesh.repair.fill_holes(mesh)
    turned = _orient(mesh)
    if solid(mesh) is not mesh:
        return mesh, HULL_MASS
    return mesh, CLOSED if whole and not turned else REPAIRED


def solid(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The closed surface that carries the mass of a mesh: the mesh itself, or its convex hull where it is open."""
    hull = mesh.convex_hull
    closed = mesh.is_watertight and mesh.is_winding_consistent
    return mesh if closed and _signed_volume(mesh) > MIN_SOLID * hull.volume else hull


def mass_properties(mesh: trimesh.Trimesh, density: float) -> tuple[float, np.ndarray]:
    """Mass (kg) and inertia (3, 3) (kg m^2) about the centre of mass, along the mesh's axes.

    mesh: metres; density: kg/m^3, uniform inside the surface, or inside the convex hull of an open one.
    """
    body = solid(mesh)
    centred = body.vertices - body.center_mass  # far from the origin the volume integrals cancel badly
    body = trimesh.Trimesh(centred, body.faces, process=False)
    return float(body.volume * density), np.asarray(body.moment_inertia) * density


def fingerprint(mesh: trimesh.Trimesh) -> str:
    """Hash of a mesh's vertices and faces: equal for the same shape under two names."""
    digest = hashlib.blake2b(np.ascontiguousarray(mesh.vertices, dtype="<f8").tobytes(), digest_size=16)
    digest.update(np.ascontiguousarray(mesh.faces, dtype="<i8").tobytes())
    return digest.hexdigest()


def _check(vertices: np.ndarray, faces: np.ndarray) -> None:
    """vertices (n, 3), faces (m, 3): RejectedMeshError where they cannot be an object."""
    if not np.isfinite(vertices).all():
        raise RejectedMeshError("a vertex is not finite")
    if len(faces) < MIN_FACES:
        raise RejectedMeshError(f"{len(faces)} faces; an object takes at least {MIN_FACES}")


def _welded(vertices: np.ndarray, faces: np.ndarray) -> trimesh.Trimesh:
    """Vertices that coincide to 1e-8 of the size merged; unused ones, collapsed faces and repeated faces dropped."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    size = float(np.max(mesh.extents))
    # a closed surface may touch itself: welding it there would open it
    if size > 0 and not mesh.is_watertight:
        mesh.merge_vertices(digits_vertex=8 - int(np.ceil(np.log10(size))))
    corners = np.sort(mesh.faces, axis=1)
    mesh.update_faces((corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]))
    mesh.update_faces(mesh.unique_faces())
    mesh.remove_unreferenced_vertices()
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def _orient(mesh: trimesh.Trimesh) -> bool:
    """Make the faces of each connected piece agree and point outwards, in place; whether any had to be turned."""
    piece, flip = _windings(np.asarray(mesh.faces), mesh.face_adjacency, mesh.face_adjacency_edges)
    faces = np.where(flip[:, None], mesh.faces[:, ::-1], mesh.faces)
    corners = mesh.vertices[faces]
    count = piece.max() + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, piece, corners.min(axis=1))
    np.maximum.at(high, piece, corners.max(axis=1))
    # volume of each piece, reckoned from its own middle so that an open one has a meaning too
    a, b, c = np.moveaxis(corners - ((low + high) / 2)[piece][:, None], 1, 0)
    inverted = np.bincount(piece, np.einsum("ij,ij->i", a, np.cross(b, c))) < 0
    # one that lies inside another may be the wall of a hollow and stays
    for i in np.flatnonzero(inverted):
        inverted[i] = not ((low < low[i]) & (high > high[i])).all(axis=1).any()
    flip = flip ^ inverted[piece]
    mesh.faces = np.where(flip[:, None], mesh.faces[:, ::-1], mesh.faces)
    return bool(flip.any())


def _windings(faces: np.ndarray, pairs: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The connected piece (m,) int of each face, and which faces (m,) bool to flip so that each piece agrees.

    faces: (m, 3); pairs: (n, 2) faces that share the edges: (n, 2). A sheet with one side only, as a Moebius strip,
    stays as it is. (`trimesh.repair.fix_winding` walks face by face: seconds for a ModelNet airplane.)
    """
    count = len(faces)
    ahead = [
        ((faces[side] == edges[:, :1]) & (np.roll(faces[side], -1, axis=1) == edges[:, 1:])).any(axis=1)
        for side in pairs.T
    ]
    clash = (ahead[0] == ahead[1]) * count  # two faces agree if they run along their edge in opposite directions
    # each face as it is (i) and flipped (i + count), joined where they would agree
    left = np.concatenate([pairs[:, 0], pairs[:, 0] + count])
    right = np.concatenate([pairs[:, 1] + clash, pairs[:, 1] + count - clash])
    side = connected_components(coo_array((np.ones(len(left)), (left, right)), (2 * count, 2 * count)), False)[1]
    piece = connected_components(coo_array((np.ones(len(pairs)), tuple(pairs.T)), (count, count)), False)[1]
    first = np.unique(piece, return_index=True)[1]
    return piece, side[:count] != side[first[piece]]


def _signed_volume(mesh: trimesh.Trimesh) -> float:
    """Volume of a closed mesh, negative where it is inside out; trimesh would also divide by it."""
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def _hull_volume(mesh: trimesh.Trimesh) -> float:
    """Volume of the convex hull; by scipy, since trimesh jiggles the points of a flat mesh until they have a hull."""
    try:
        return float(ConvexHull(mesh.vertices).volume)
    except QhullError:
        return 0.0
