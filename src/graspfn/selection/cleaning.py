"""Making a mesh fit to be seen and simulated: repairs, and one closed surface where there can be one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from graspfn.meshes.mass import HULL, VOLUME, solid
from graspfn.selection.fitness import check_body, check_surface
from graspfn.selection.pieces import boxes, connected
from graspfn.selection.solids import solids_united

WELD = 1e-6  # of the size: vertices so near are one; single precision tells no more apart
HOLE = 0.2  # a hole no longer than this share of its piece is closed; a longer one may be the mouth of a cup
FLAT = 1e-6  # volume of a piece over the cube of its size, below which it has no inside


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
    vertices, faces = _used(np.asarray(raw.vertices), np.asarray(raw.faces))
    # libraries take what is smaller than about 1e-8 for nothing; a power of two changes no digit
    unit = 2.0 ** np.round(np.log2(check_surface(vertices, faces)))
    mesh = _welded(vertices / unit, faces, steps)
    check_surface(mesh.vertices, mesh.faces)
    mesh = solids_united(mesh, steps) or _mended(mesh, steps)
    check_body(mesh)
    mass = VOLUME if solid(mesh) is mesh else HULL
    return Cleaned(trimesh.Trimesh(mesh.vertices * unit, mesh.faces, process=False), mass, "; ".join(steps))


def _used(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Without the vertices that no face has."""
    used, corners = np.unique(faces, return_inverse=True)
    return (vertices, faces) if len(used) == len(vertices) else (vertices[used], corners.reshape(-1, 3))


def _welded(vertices: np.ndarray, faces: np.ndarray, steps: list[str]) -> trimesh.Trimesh:
    """Vertices that coincide merged; faces that collapsed, or that are there twice with one winding, dropped."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    # a closed surface may touch itself: welding it there would open it
    if not mesh.is_watertight:
        places, owner = np.unique(vertices, axis=0, return_inverse=True)
        size = np.ptp(vertices, axis=0).max()
        group = connected(cKDTree(places).query_pairs(WELD * size, output_type="ndarray"), len(places))
        _, keep, owner = np.unique(group[owner.ravel()], return_index=True, return_inverse=True)
        if len(keep) < len(vertices):
            steps.append("vertices merged")
        vertices, faces = vertices[keep], owner.ravel()[faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    turn = faces.argmin(axis=1)[:, None]  # equal faces of one winding start with the same corner then
    _, once = np.unique(np.take_along_axis(faces, (turn + np.arange(3)) % 3, axis=1), axis=0, return_index=True)
    if len(once) < len(mesh.faces):
        steps.append(f"{len(mesh.faces) - len(once)} collapsed or repeated faces dropped")
        faces = faces[np.sort(once)]
    return trimesh.Trimesh(*_used(vertices, faces), process=False)


def _mended(mesh: trimesh.Trimesh, steps: list[str]) -> trimesh.Trimesh:
    """A mesh whose faces do not close as they are: sheets single, windings agreeing, small holes closed."""
    sheets = mesh.unique_faces()  # a sheet may have a face on either side
    if not np.all(sheets):
        steps.append(f"{np.count_nonzero(~sheets)} back faces dropped")
        mesh = trimesh.Trimesh(*_used(mesh.vertices, mesh.faces[sheets]), process=False)
    mesh = _agreeing(mesh, steps)
    mesh = _holes_closed(mesh, steps)
    return solids_united(mesh, steps, alone=False) or mesh


def _agreeing(mesh: trimesh.Trimesh, steps: list[str]) -> trimesh.Trimesh:
    """The faces of each connected piece made to agree and, where it has an inside, to point outwards."""
    piece, flip = _windings(np.asarray(mesh.faces), mesh.face_adjacency, mesh.face_adjacency_edges)
    triangles = np.where(flip[:, None, None], mesh.triangles[:, ::-1], mesh.triangles)
    low, high = boxes(piece, triangles.min(axis=1), triangles.max(axis=1))
    # volume of each piece, reckoned from its own middle so that an open one has a meaning too
    corners = np.bincount(piece)[:, None]
    middle = np.column_stack([np.bincount(piece, triangles.mean(axis=1)[:, k]) for k in range(3)]) / corners
    a, b, c = np.moveaxis(triangles - middle[piece][:, None], 1, 0)
    volume = np.bincount(piece, np.einsum("ij,ij->i", a, np.cross(b, c))) / 6
    flip = flip ^ (volume < -FLAT * (high - low).max(axis=1) ** 3)[piece]
    if flip.any():
        steps.append(f"{np.count_nonzero(flip)} faces turned")
    return trimesh.Trimesh(mesh.vertices, np.where(flip[:, None], mesh.faces[:, ::-1], mesh.faces), process=False)


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
    side = connected(np.column_stack([left, right]), 2 * count)
    piece = connected(pairs, count)
    first = np.unique(piece, return_index=True)[1]
    return piece, side[:count] != side[first[piece]]


def _holes_closed(mesh: trimesh.Trimesh, steps: list[str]) -> trimesh.Trimesh:
    """The mesh with a fan of faces over the holes of every piece that small ones alone keep open.

    A hole is a simple loop of edges that one face each runs along. Pieces that would stay open keep their holes too:
    nothing would be gained, and a colander has its holes for a reason.
    """
    edges = mesh.edges  # (3 m, 2), as the faces run along them
    _, inverse, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    rim = edges[count[inverse.ravel()] == 1]
    if len(rim) == 0:
        return mesh
    loop = connected(rim, len(mesh.vertices))[rim[:, 0]]
    _, starts, loop = np.unique(loop, return_index=True, return_inverse=True)
    # simple: it enters and leaves each of its vertices once
    leaves, enters = (np.bincount(rim[:, k], minlength=len(mesh.vertices)) for k in (0, 1))
    simple = np.bincount(loop, (leaves[rim[:, 0]] != 1) | (enters[rim[:, 0]] != 1)) == 0
    piece = connected(edges, len(mesh.vertices))
    across = np.ptp(boxes(loop, mesh.vertices[rim[:, 0]]), axis=0).max(axis=1)
    whole = np.ptp(boxes(piece, mesh.vertices), axis=0).max(axis=1)
    of = piece[rim[starts, 0]]
    good = simple & (across <= HOLE * whole[of])
    closed = np.flatnonzero((np.bincount(of, ~good) == 0)[of])
    if len(closed) == 0:
        return mesh
    new = np.full(len(starts), -1)
    new[closed] = len(mesh.vertices) + np.arange(len(closed))
    around = new[loop] >= 0
    fans = np.column_stack([rim[around][:, ::-1], new[loop[around]]])
    size = np.bincount(loop)[closed, None]
    middles = np.column_stack([np.bincount(loop, mesh.vertices[rim[:, 0], k])[closed] for k in range(3)]) / size
    steps.append(f"{len(closed)} holes closed")
    return trimesh.Trimesh(np.vstack([mesh.vertices, middles]), np.vstack([mesh.faces, fans]), process=False)
