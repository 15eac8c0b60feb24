"""Closed parts of a mesh made into one: which are solid and which are hollows, and the surface of all together."""

from __future__ import annotations

import numpy as np
import trimesh
from manifold3d import Error, Manifold, Mesh64, OpType

from graspfn.meshes.errors import RejectedMeshError
from graspfn.meshes.mass import MIN_SOLID
from graspfn.selection.pieces import connected

MOST_PARTS = 3000  # closed ones: a union of so many takes seconds, of ten times as many minutes
SEAM = 1e-6  # of the size: what tidying the seams of united parts may move the surface by
LOST = 1e-3  # share of the area that may be faces back to back, which bound nothing and are dropped
INSIDE = 1e-6  # share of a hollow that may lie outside the part it is in


def solids_united(mesh: trimesh.Trimesh, steps: list[str], alone: bool = True) -> trimesh.Trimesh | None:
    """The surface of all closed parts together, with the open pieces of the mesh as they are.

    None where there is nothing to unite: no part is closed or, with `alone`, a piece of the mesh is open.
    """
    middle = mesh.bounds.mean(axis=0)  # far from the origin a boolean would lose digits
    whole = _closed(mesh.vertices - middle, mesh.faces)
    rest: list[trimesh.Trimesh] = []
    if whole is not None:
        parts = whole.decompose()
    elif alone:
        return None
    else:
        parts, rest = _closed_pieces(mesh, middle)
    if len(parts) > MOST_PARTS:
        raise RejectedMeshError(f"too many parts: {len(parts)} closed ones; an object takes at most {MOST_PARTS}")
    closed = [part for part in parts if _has_inside(part)]
    if len(closed) < len(parts) and alone:
        return None  # sheets with a face on either side
    if not closed:
        return None
    rest += [_trimesh(part) for part in parts if not _has_inside(part)]
    if len(closed) == 1 and not rest and mesh.is_watertight and closed[0].volume() > 0:
        return mesh
    united = _trimesh(_union(closed, SEAM * float(mesh.extents.max()), steps))
    offsets = np.cumsum([0, len(united.vertices), *(len(piece.vertices) for piece in rest)])
    pieces = [united, *rest]
    faces = [piece.faces + offset for piece, offset in zip(pieces, offsets, strict=False)]
    return trimesh.Trimesh(np.vstack([piece.vertices for piece in pieces]) + middle, np.vstack(faces), process=False)


def _closed_pieces(mesh: trimesh.Trimesh, middle: np.ndarray) -> tuple[list[Manifold], list[trimesh.Trimesh]]:
    """The pieces of a mesh about its middle that share no vertex: closed ones as parts, all others as one mesh."""
    owner = connected(mesh.edges, len(mesh.vertices))[mesh.faces[:, 0]]
    order = np.argsort(owner, kind="stable")
    parts, still_open = [], []
    for faces in np.split(order, np.flatnonzero(np.diff(owner[order])) + 1):
        if len(faces) > 3:
            corners, inverse = np.unique(mesh.faces[faces], return_inverse=True)
            part = _closed(mesh.vertices[corners] - middle, inverse.reshape(-1, 3))
            if part is not None:
                parts += part.decompose()
                continue
        still_open.append(faces)
    if not still_open:
        return parts, []
    rest = trimesh.Trimesh(mesh.vertices - middle, mesh.faces[np.sort(np.concatenate(still_open))], process=False)
    rest.remove_unreferenced_vertices()
    return parts, [rest]


def _closed(vertices: np.ndarray, faces: np.ndarray) -> Manifold | None:
    """The solid that faces bound, None where they do not close or, in part, lie on each other's backs."""
    if not _paired(faces):
        return None
    whole = Manifold(Mesh64(np.array(vertices, dtype=np.float64, order="C"), np.array(faces, np.uint64, order="C")))
    if whole.status() != Error.NoError:
        return None
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    return whole if whole.surface_area() > (1 - LOST) * area else None


def _paired(faces: np.ndarray) -> bool:
    """Whether faces (m, 3) run along every edge as often one way as the other; on some that do not, Manifold crashes
    instead of saying so."""
    ahead, count = np.roll(faces, -1, axis=1).astype(np.int64), int(faces.max()) + 1
    return np.array_equal(np.sort(faces * count + ahead, axis=None), np.sort(ahead * count + faces, axis=None))


def _has_inside(part: Manifold) -> bool:
    """Whether a closed part bounds more than rounding errors; a sheet with a face on either side does not."""
    low, high = np.array(part.bounding_box()).reshape(2, 3)
    return abs(part.volume()) > MIN_SOLID * float(np.prod(np.maximum(high - low, 1e-9 * (high - low).max())))


def _union(parts: list[Manifold], seam: float, steps: list[str]) -> Manifold:
    """All parts together, each less its hollows.

    If the largest part is inside out, all are taken to be. Then one that still is, and that lies inside the material
    of another, is a hollow of the smallest such; any other was wound the wrong way, and is turned.
    """
    parts = sorted(parts, key=lambda part: -abs(part.volume()))
    turned = parts[0].volume() < 0
    if turned:
        parts = [_inverted(part) for part in parts]
    outer = [part for part in parts if part.volume() > 0]
    walls: dict[int, list[Manifold]] = {}
    for wall in (_inverted(part) for part in parts if part.volume() < 0):
        owner = next((i for i in reversed(range(len(outer))) if _within(wall, outer[i])), None)
        if owner is None:
            outer.append(wall)
            turned = True
        else:
            walls.setdefault(owner, []).append(wall)
    if turned:
        steps.append("turned outwards")
    hollowed = [
        part - Manifold.batch_boolean(walls[i], OpType.Add) if i in walls else part for i, part in enumerate(outer)
    ]
    if len(outer) == 1:
        return hollowed[0]
    steps.append(f"{len(outer)} parts united")
    # as_original forgets which part a face came from, which would keep the seams from being tidied
    return Manifold.batch_boolean(hollowed, OpType.Add).as_original().simplify(seam)


def _within(inner: Manifold, outer: Manifold) -> bool:
    a, b = (np.array(part.bounding_box()).reshape(2, 3) for part in (inner, outer))
    if (a[0] < b[0]).any() or (a[1] > b[1]).any():
        return False
    return bool((inner - outer).volume() <= INSIDE * inner.volume())


def _inverted(part: Manifold) -> Manifold:
    mesh = part.to_mesh64()
    flipped = np.array(mesh.tri_verts[:, ::-1], order="C")
    return Manifold(Mesh64(np.array(mesh.vert_properties[:, :3], order="C"), flipped))


def _trimesh(part: Manifold) -> trimesh.Trimesh:
    mesh = part.to_mesh64()
    vertices, faces = np.array(mesh.vert_properties[:, :3]), np.array(mesh.tri_verts, dtype=np.int64)
    return trimesh.Trimesh(vertices, faces, process=False)
