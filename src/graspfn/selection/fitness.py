"""What no object to grasp may be: each check raises RejectedMeshError, its reason a name, a colon and the details."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy import ndimage
from scipy.spatial import ConvexHull, QhullError

from graspfn.meshes.errors import RejectedMeshError
from graspfn.selection.pieces import boxes, connected

MIN_FACES = 4  # a tetrahedron
MAX_FACES = 500_000  # cleaning takes ten seconds
MIN_FILL = 1e-5  # hull volume over the cube of the largest extent: 0.6 mm thick at 20 cm long is a line to a gripper
STRAY, STRAYS = 20, 0.01  # so much farther out than all but so many of the vertices
CRUMB, CRUMBS = 0.1, 100  # of the size: what the longest of more pieces than these must reach
GAP = 1 / 16  # of the size: pieces farther apart are not one body; at half of it they count as touching
SAMPLES = 50_000  # points of the surface: eight to each cell of a box


def check_surface(vertices: np.ndarray, faces: np.ndarray) -> float:
    """vertices (n, 3), all used, faces (m, 3): the largest extent; reject what has no surface to speak of."""
    with np.errstate(over="ignore", invalid="ignore"):
        size = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    if not np.isfinite(vertices).all() or not np.isfinite(size):
        raise RejectedMeshError("not finite: a vertex is not a finite number")
    if len(faces) < MIN_FACES:
        raise RejectedMeshError(f"too few faces: {len(faces)}; an object takes at least {MIN_FACES}")
    if len(faces) > MAX_FACES:
        raise RejectedMeshError(f"too many faces: {len(faces)}; simplify it to {MAX_FACES} or fewer")
    if size < np.finfo(float).tiny:
        raise RejectedMeshError("no volume: all of it lies in one point")
    return size


def check_body(mesh: trimesh.Trimesh) -> None:
    """A clean mesh: reject what is flat, stretched by stray vertices, or not one body."""
    if len(mesh.faces) == 0:
        raise RejectedMeshError("no volume: none of it is left once it is cleaned")
    size = float(mesh.extents.max())
    if _hull_volume(mesh) <= MIN_FILL * size**3:
        raise RejectedMeshError("no volume: it is thinner than a needle, or lies in one plane")
    far = np.sort(np.linalg.norm(mesh.vertices - np.median(mesh.vertices, axis=0), axis=1))
    usual = far[-1 - int(np.ceil(STRAYS * len(far)))]
    if far[-1] > STRAY * usual:
        raise RejectedMeshError(f"stray vertex: it lies {far[-1] / usual:.0f} times as far out as nearly all others")
    piece = connected(mesh.edges, len(mesh.vertices))
    low, high = boxes(piece, mesh.vertices)
    if len(low) > CRUMBS and (high - low).max() < CRUMB * size:
        raise RejectedMeshError(f"crumbs: {len(low)} pieces, none as long as a tenth of the whole")
    count = _bodies(mesh, piece, GAP * size)
    if count > 1:
        raise RejectedMeshError(f"in pieces: {count}, more than a sixteenth of its size apart")


def _bodies(mesh: trimesh.Trimesh, piece: np.ndarray, gap: float) -> int:
    """How many bodies a mesh falls into if pieces touch that leave no cell of a grid, half a `gap` wide, between them.

    piece: (n,) int, which piece each vertex is in. Found meshes are rarely joined where they look it: legs only poke
    into a seat. What lies within the box around something else may be the wall of a hollow, and is no body of its own.
    """
    samples, face = trimesh.sample.sample_surface(mesh, SAMPLES, seed=0)
    points = np.vstack([mesh.vertices, samples])
    owner = np.concatenate([piece, piece[mesh.faces[face, 0]]])
    cells = np.floor((points - points.min(axis=0)) / (gap / 2)).astype(int)
    filled = np.zeros(cells.max(axis=0) + 1, dtype=bool)
    filled[tuple(cells.T)] = True
    region = ndimage.label(filled, np.ones((3, 3, 3)))[0][tuple(cells.T)]
    # one body: pieces that reach into one region of touching cells, regions that one piece reaches into
    count = piece.max() + 1
    body = np.unique(
        connected(np.column_stack([owner, count + region]), count + region.max() + 1)[owner], return_inverse=True
    )[1]
    low, high = boxes(body, points)
    return sum(not ((low < low[i]) & (high > high[i])).all(axis=1).any() for i in range(len(low)))


def _hull_volume(mesh: trimesh.Trimesh) -> float:
    """Volume of the convex hull; by scipy, since trimesh jiggles the points of a flat mesh until they have a hull."""
    try:
        return float(ConvexHull(mesh.vertices).volume)
    except QhullError:
        return 0.0
