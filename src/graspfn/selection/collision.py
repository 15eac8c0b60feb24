"""Collision meshes: the few faces that physics needs of a mesh, within a tolerance of it."""

from __future__ import annotations

import fast_simplification
import numpy as np
import trimesh
from scipy.spatial import cKDTree

AGGRESSION = 3  # of 10: the default of 7 departs from the mesh three times as far at equal faces
MANY = 20_000  # faces of a collision mesh: physics is slow with so many, whether or not they are the fewest
PROBES, MORE = 200, 16  # points of a mesh that are looked at first, and how many times more each time after that


def collision_mesh(mesh: trimesh.Trimesh, faces: int, tolerance: float) -> trimesh.Trimesh:
    """The mesh with about `faces` faces, or as many more as keep it within `tolerance` (m) of the mesh, measured at the
    vertices and the middles of the faces of both.

    Contacts, and with them the time of a step, grow with the faces. What comes back may be open: it is a surface to
    touch, while mass and inside are those of the mesh itself.
    """
    if len(mesh.faces) <= faces:
        return mesh
    simple = _decimated(mesh, mesh, faces, tolerance)
    if len(simple.faces) > 4 * faces:
        # No edge of a soup of triangles can be collapsed; with its corners drawn together it is less of one.
        simple = min(
            simple, _decimated(_merged(mesh, tolerance / 2), mesh, faces, tolerance), key=lambda m: len(m.faces)
        )
    return simple


def _decimated(start: trimesh.Trimesh, mesh: trimesh.Trimesh, faces: int, tolerance: float) -> trimesh.Trimesh:
    """`start` with the fewest faces, from `faces` up, that stay within `tolerance` (m) of `mesh`; else `mesh`."""
    vertices = np.array(start.vertices, dtype=np.float64, order="C")
    triangles = np.array(start.faces, dtype=np.int64, order="C")
    while faces < len(triangles):
        points, corners = fast_simplification.simplify(vertices, triangles, target_count=faces, agg=AGGRESSION)
        simple = trimesh.Trimesh(points, corners, process=False)
        if _within(simple, mesh, tolerance):
            return simple
        faces = _more(faces)
        if len(corners) >= faces:  # no further edge could be collapsed, nor can it for a few faces more
            faces = _more(len(corners) + 1)
    return start if start is not mesh and _within(start, mesh, tolerance) else mesh


def _more(faces: int) -> int:
    """How many faces to try next: from MANY up in larger steps, since every try takes up to a second."""
    return faces + faces // 2 if faces < MANY else 3 * faces


def _merged(mesh: trimesh.Trimesh, cell: float) -> trimesh.Trimesh:
    """The mesh with the vertices of every cell of a grid (m) drawn together in their mean."""
    _, owner = np.unique(np.round(mesh.vertices / cell).astype(np.int64), axis=0, return_inverse=True)
    owner = owner.ravel()
    count = np.bincount(owner)
    vertices = np.column_stack([np.bincount(owner, mesh.vertices[:, axis]) / count for axis in range(3)])
    merged = trimesh.Trimesh(vertices, owner[mesh.faces], process=False)
    corners = np.sort(merged.faces, axis=1)
    merged.update_faces((corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]))
    merged.update_faces(merged.unique_faces())
    merged.remove_unreferenced_vertices()
    return merged


def _within(simple: trimesh.Trimesh, mesh: trimesh.Trimesh, tolerance: float) -> bool:
    """Whether no vertex and no middle of a face of either lies farther than `tolerance` (m) from the other."""
    theirs, ours = (np.vstack([surface.vertices, surface.triangles_center]) for surface in (simple, mesh))
    probes = PROBES
    while probes < len(ours):  # most meshes that fail fail at the first of them, at little cost
        if outside(ours[:: len(ours) // probes + 1], simple, tolerance).any():
            return False
        probes *= MORE
    return not (outside(ours, simple, tolerance).any() or outside(theirs, mesh, tolerance).any())


def outside(points: np.ndarray, mesh: trimesh.Trimesh, tolerance: float) -> np.ndarray:
    """(n,) bool: which points (n, 3) lie farther than `tolerance` (m) from the surface of a mesh."""
    triangles = mesh.triangles
    # most lie near a corner, which is quickly found
    far = cKDTree(triangles.reshape(-1, 3)).query(points)[0] > tolerance
    if not far.any():
        return far
    left = np.flatnonzero(far)
    centres = triangles.mean(axis=1)
    radii = np.linalg.norm(triangles - centres[:, None], axis=2).max(axis=1)
    tree = cKDTree(points[left])
    for part in np.array_split(np.arange(len(triangles)), len(triangles) // 500 + 1):
        # only points in the ball around a triangle and its tolerance can be near it
        near = tree.query_ball_point(centres[part], radii[part] + tolerance)
        point = left[np.concatenate([np.array(found, dtype=int) for found in near])]
        face = np.repeat(part, [len(found) for found in near])
        keep = far[point]  # the others are near already
        point, face = point[keep], face[keep]
        if len(point) == 0:
            continue
        closest = trimesh.triangles.closest_point(triangles[face], points[point])
        distance = np.linalg.norm(closest - points[point], axis=1)
        far[point[distance <= tolerance]] = False
    return far
