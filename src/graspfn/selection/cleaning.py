"""Making a mesh fit to be seen and simulated: repairs, and one closed surface where there can be one."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
import trimesh
from manifold3d import Error, Manifold, Mesh64, OpType
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from graspfn.meshes.mass import HULL, MIN_SOLID, VOLUME, signed_volume, solid
from graspfn.selection.fitness import check_object, check_surface

HOLE = 0.2  # a hole no longer than this share of its piece is closed; a longer one may be the mouth of a cup
SEAM = 1e-4  # of the size: what simplifying the seams of united parts may move the surface by


@dataclass(frozen=True)
class Cleaned:
    """A mesh that can be an object, in the units it came in.

    mass: "volume" where the surface closes, "convex hull" where it stays open and its mass, centre and inertia are
    those of its hull. steps: what was done, "" for nothing.
    """

    mesh: trimesh.Trimesh
    mass: str
    steps: str


def clean(raw: trimesh.Trimesh) -> Cleaned:
    """A repaired copy of a mesh, without colours or normals. Raises RejectedMeshError with the reason.

    Merges vertices, drops collapsed and repeated faces, makes windings agree and point outwards, closes small holes,
    and unites parts that overlap or touch into one surface without anything inside.
    """
    steps = [raw.metadata["source_note"]] if "source_note" in raw.metadata else []
    check_surface(np.asarray(raw.vertices), np.asarray(raw.faces))
    # libraries take what is smaller than about 1e-8 for nothing; a power of two changes no digit
    size = np.ptp(np.asarray(raw.vertices)[np.unique(raw.faces)], axis=0).max()
    unit = 2.0 ** np.round(np.log2(max(size, np.finfo(float).tiny)))
    mesh = _welded(np.asarray(raw.vertices) / unit, np.asarray(raw.faces), steps)
    check_surface(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    check_object(mesh)
    _orient(mesh, steps)
    if not mesh.is_watertight:
        mesh = _holes_closed(mesh, steps)
    mesh = _united(mesh, steps)
    mass = VOLUME if solid(mesh) is mesh else HULL
    return Cleaned(trimesh.Trimesh(mesh.vertices * unit, mesh.faces, process=False), mass, "; ".join(steps))


def _welded(vertices: np.ndarray, faces: np.ndarray, steps: list[str]) -> trimesh.Trimesh:
    """Vertices that coincide to 1e-8 of the size merged; unused ones, collapsed faces and repeated faces dropped."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    size = float(np.max(mesh.extents))
    # a closed surface may touch itself: welding it there would open it
    if size > 0 and not mesh.is_watertight:
        mesh.merge_vertices(digits_vertex=8 - int(np.ceil(np.log10(size))))
        if len(mesh.vertices) < len(vertices):
            steps.append("vertices merged")
    corners = np.sort(mesh.faces, axis=1)
    mesh.update_faces((corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]))
    once = mesh.unique_faces()
    # a sheet with a face on either side takes one of them; a solid that pinches to such a pair takes both
    if not np.all(once) and not _encloses(mesh):
        mesh.update_faces(once)
    mesh.remove_unreferenced_vertices()
    if dropped := len(faces) - len(mesh.faces):
        steps.append(f"{dropped} collapsed or repeated faces dropped")
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def _encloses(mesh: trimesh.Trimesh) -> bool:
    """Whether the faces, each run along every edge as often one way as the other, bound a volume."""
    whole = _manifold(mesh.vertices - mesh.bounds.mean(axis=0), mesh.faces)
    return whole.status() == Error.NoError and abs(whole.volume()) > MIN_SOLID * mesh.convex_hull.volume


def _orient(mesh: trimesh.Trimesh, steps: list[str]) -> None:
    """Make the faces of each connected piece agree and point outwards, in place."""
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
    if flip.any():
        steps.append(f"{np.count_nonzero(flip)} faces turned")


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


def _holes_closed(mesh: trimesh.Trimesh, steps: list[str]) -> trimesh.Trimesh:
    """The mesh with a fan of faces over every small hole: a simple loop of edges that one face each runs along."""
    edges = mesh.edges  # (3 m, 2), as the faces run along them
    _, inverse, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    rim = edges[count[inverse.ravel()] == 1]
    if len(rim) == 0:
        return mesh
    n = len(mesh.vertices)
    loop = connected_components(coo_array((np.ones(len(rim)), tuple(rim.T)), (n, n)), False)[1][rim[:, 0]]
    piece = connected_components(coo_array((np.ones(len(edges)), tuple(edges.T)), (n, n)), False)[1]
    leaves, enters = (Counter(rim[:, k].tolist()) for k in (0, 1))
    vertices, faces = list(mesh.vertices), [np.asarray(mesh.faces)]
    closed = 0
    for i in np.unique(loop):
        around = rim[loop == i]
        corners = mesh.vertices[around[:, 0]]
        simple = all(leaves[v] == enters[v] == 1 for v in around[:, 0].tolist())
        whole = mesh.vertices[piece == piece[around[0, 0]]]
        if simple and np.ptp(corners, axis=0).max() <= HOLE * np.ptp(whole, axis=0).max():
            faces.append(np.column_stack([around[:, ::-1], np.full(len(around), len(vertices))]))
            vertices.append(corners.mean(axis=0))
            closed += 1
    if closed:
        steps.append(f"{closed} holes closed")
    return trimesh.Trimesh(np.array(vertices), np.concatenate(faces), process=False)


def _united(mesh: trimesh.Trimesh, steps: list[str]) -> trimesh.Trimesh:
    """The outer surface of all closed parts together, less their hollows; the mesh itself where a part is open."""
    middle = mesh.bounds.mean(axis=0)  # far from the origin a boolean would lose digits
    whole = _manifold(mesh.vertices - middle, mesh.faces)
    if whole.status() != Error.NoError:
        return mesh
    parts = whole.decompose()
    if len(parts) == 1 and mesh.is_watertight:
        return mesh
    outer = [part for part in parts if part.volume() > 0]
    if not outer:
        return mesh
    hollows = [part.to_mesh64() for part in parts if part.volume() < 0]
    union = Manifold.batch_boolean(outer, OpType.Add)
    for hollow in hollows:
        union -= _manifold(hollow.vert_properties[:, :3], hollow.tri_verts[:, ::-1])
    # as_original forgets which part a face came from, which would keep the seams from being simplified
    union = union.as_original().simplify(SEAM * float(mesh.extents.max()))
    result = union.to_mesh64()
    united = trimesh.Trimesh(
        np.array(result.vert_properties[:, :3]) + middle, np.array(result.tri_verts, dtype=np.int64), process=False
    )
    if not united.is_watertight or signed_volume(united) <= 0:
        return mesh
    steps.append(f"{len(parts)} parts united" if len(parts) > 1 else "touching edges parted")
    return united


def _manifold(vertices: np.ndarray, faces: np.ndarray) -> Manifold:
    return Manifold(Mesh64(np.array(vertices, dtype=np.float64, order="C"), np.array(faces, np.uint64, order="C")))
