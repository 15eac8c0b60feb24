"""What no object to grasp may be: each check raises RejectedMeshError, its reason a name, a colon and the details."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from graspfn.meshes.errors import RejectedMeshError

MIN_FACES = 4  # a tetrahedron
MAX_FACES = 500_000  # ten times the largest of ModelNet40's common meshes; cleaning takes a minute
MIN_FILL = 1e-5  # hull volume over the cube of the largest extent: 0.6 mm thick at 20 cm long is a line to a gripper
OUTLIER = 20  # times as far out as any other vertex
CRUMB = 0.1  # of the size: what the longest connected piece must reach
GAP = 1 / 16  # of the size: pieces farther apart are not one body; at half of it they count as touching
SAMPLES = 50_000  # points of the surface: eight to each cell of a box


def check_surface(vertices: np.ndarray, faces: np.ndarray) -> None:
    """vertices (n, 3), faces (m, 3): reject what has no surface to speak of."""
    if not np.isfinite(vertices).all():
        raise RejectedMeshError("not finite: a vertex is not a finite number")
    if len(faces) < MIN_FACES:
        raise RejectedMeshError(f"too few faces: {len(faces)}; an object takes at least {MIN_FACES}")
    if len(faces) > MAX_FACES:
        raise RejectedMeshError(f"too many faces: {len(faces)}; simplify it to {MAX_FACES} or fewer")


def check_object(mesh: trimesh.Trimesh) -> None:
    """A mesh with merged vertices: reject what is flat, stretched by a stray vertex, or not one body."""
    size = float(mesh.extents.max())
    if _hull_volume(mesh) <= MIN_FILL * size**3:
        raise RejectedMeshError("no volume: all of it lies in one plane or line")
    far = np.sort(np.linalg.norm(mesh.vertices - np.median(mesh.vertices, axis=0), axis=1))
    if far[-1] > OUTLIER * far[-2]:
        raise RejectedMeshError(f"stray vertex: one lies {far[-1] / far[-2]:.0f} times as far out as any other")
    sizes = _piece_sizes(mesh)
    if sizes.max() < CRUMB * size:
        raise RejectedMeshError(f"crumbs: {len(sizes)} pieces, none as long as a tenth of the whole")
    count = _bodies(mesh, GAP * size)
    if count > 1:
        raise RejectedMeshError(f"in pieces: {count}, more than a sixteenth of its size apart")


def _piece_sizes(mesh: trimesh.Trimesh) -> np.ndarray:
    """Largest extent of each piece that shares no vertex with the others."""
    n = len(mesh.vertices)
    edges = mesh.edges
    count, piece = connected_components(coo_array((np.ones(len(edges)), tuple(edges.T)), (n, n)), False)
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, piece, mesh.vertices)
    np.maximum.at(high, piece, mesh.vertices)
    return (high - low).max(axis=1)


def _bodies(mesh: trimesh.Trimesh, gap: float) -> int:
    """How many bodies a mesh falls into if pieces touch that leave no cell of a grid, half a `gap` wide, between them.

    Found meshes are rarely joined where they look it: legs only poke into a seat. A piece within the box around
    another may be the wall of a hollow and is none of its own.
    """
    points = np.vstack([mesh.vertices, trimesh.sample.sample_surface(mesh, SAMPLES, seed=0)[0]])
    cells = np.floor((points - points.min(axis=0)) / (gap / 2)).astype(int)
    filled = np.zeros(cells.max(axis=0) + 1, dtype=bool)
    filled[tuple(cells.T)] = True
    boxes = ndimage.find_objects(ndimage.label(filled, np.ones((3, 3, 3)))[0])
    low, high = (np.array([[getattr(side, end) for side in box] for box in boxes]) for end in ("start", "stop"))
    return sum(not ((low < low[i]) & (high > high[i])).all(axis=1).any() for i in range(len(boxes)))


def _hull_volume(mesh: trimesh.Trimesh) -> float:
    """Volume of the convex hull; by scipy, since trimesh jiggles the points of a flat mesh until they have a hull."""
    try:
        return float(ConvexHull(mesh.vertices).volume)
    except QhullError:
        return 0.0
