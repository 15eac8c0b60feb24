"""How far apart two surfaces lie when one is laid on the other, whatever their size, place, turn and handedness.

Dearer than comparing signatures, and finer: a signature's sums can agree by chance, and its logarithms take a thin wall
that is a little thicker for another shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

POINTS = 2000  # drawn on each surface
SOME, FEW = 400, 100  # of these to align by, and to choose where to begin
BEGINNINGS, BEST = 6, 2  # alignments begun, and those of them that are brought to an end
STEPS_BEGUN, STEPS_ENDED = 3, 6
SLACK = 0.1  # second moments, which sum to 1, that a beginning may leave farther apart than the best one does
WEAK = 1e-3  # singular values below this part of the largest: turning a ball about itself moves nothing
LEAST, MOST = 0.9, 1.1  # times its size in one step

Similarity = tuple[np.ndarray, np.ndarray]  # M (3, 3), t (3,): x goes to M x + t; M may mirror


@dataclass(frozen=True, eq=False)
class Surface:
    """Points drawn on a surface, about their mean, in units of their root mean square distance from it.

    points, normals: (POINTS, 3) float32, along the principal axes; moments: (3,) about these, ascending, of sum 1.
    """

    points: np.ndarray
    normals: np.ndarray
    moments: np.ndarray

    @property
    def size(self) -> float:
        """Twice the distance of the farthest point from the middle."""
        return 2 * float(np.linalg.norm(self.points, axis=1).max())


def surface_of(mesh: trimesh.Trimesh) -> Surface:
    """The same for the same mesh, always."""
    drawn, face = trimesh.sample.sample_surface(mesh, POINTS, seed=0)
    points = np.asarray(drawn) - np.mean(drawn, axis=0)
    points /= np.sqrt((points**2).sum(axis=1).mean())
    moments, axes = np.linalg.eigh(points.T @ points / POINTS)
    axes *= np.sign(axes[np.abs(axes).argmax(axis=0), range(3)])  # a library may give either sign
    return Surface((points @ axes).astype(np.float32), (mesh.face_normals[face] @ axes).astype(np.float32), moments)


def _orientations() -> np.ndarray:
    """(n, 3, 3) orthogonal: each way to turn or mirror principal axes, also turned about one of them or at random.

    With three different moments only the first eight can match; a surface of revolution takes any turn about its axis,
    and one as round as a cube any at all.
    """
    flips = [np.diag([x, y, z]) for x in (1, -1) for y in (1, -1) for z in (1, -1)]
    about = Rotation.from_rotvec([angle * axis for axis in np.eye(3) for angle in np.radians(range(30, 180, 30))])
    anyhow = Rotation.from_quat(np.random.default_rng(0).normal(size=(60, 4)))
    turns = np.concatenate([[np.eye(3)], about.as_matrix(), anyhow.as_matrix()])
    return np.concatenate([turns @ flip for flip in flips])


ORIENTATIONS = _orientations()


def gap(a: Surface, b: Surface) -> float:
    """The mean distance between two surfaces that lie on each other as well as they can, in sizes of b.

    Over the points of either, from the plane through the nearest point of the other: points that were drawn apart on
    one surface have no distance. Aligning is by these distances too, with the scale free.
    """
    on_a, on_b = (np.asarray(surface.points, dtype=float) for surface in (a, b))
    tree_a, tree_b = cKDTree(on_a), cKDTree(on_b)
    starts = _beginnings(a, b, tree_b)
    begun = [_aligned((start, np.zeros(3)), a, b, tree_b, STEPS_BEGUN) for start in starts]
    off = [tree_b.query(on_a[:SOME] @ M.T + t)[0].mean() for M, t in begun]
    found = []
    for k in np.argsort(off, kind="stable")[:BEST]:
        M, t = _aligned(begun[k], a, b, tree_b, STEPS_ENDED)
        there = _off_plane(on_a @ M.T + t, b, tree_b)
        back = _off_plane((on_b - t) @ np.linalg.inv(M).T, a, tree_a) * np.cbrt(abs(np.linalg.det(M)))
        found.append(float((there.mean() + back.mean()) / 2))
    return min(found) / b.size


def _beginnings(a: Surface, b: Surface, tree_b: cKDTree) -> np.ndarray:
    """(BEGINNINGS, 3, 3): the orientations of a that bring its second moments to those of b and its points near."""
    apart = np.linalg.norm(
        np.einsum("kij,j,klj->kil", ORIENTATIONS, a.moments, ORIENTATIONS) - np.diag(b.moments), axis=(1, 2)
    )
    fit = ORIENTATIONS[apart < apart.min() + SLACK]
    distance, _ = tree_b.query(a.points[:FEW] @ fit.transpose(0, 2, 1))
    return fit[np.argsort((distance**2).mean(axis=1), kind="stable")[:BEGINNINGS]]


def _aligned(start: Similarity, a: Surface, b: Surface, tree_b: cKDTree, steps: int) -> Similarity:
    """A start improved, so that points of a come to lie in the planes through the nearest points of b.

    Iterated closest points (Chen and Medioni 1992): least squares over small turns, shifts and changes of scale.
    """
    M, t = start
    for _ in range(steps):
        points = a.points[:SOME] @ M.T + t
        _, nearest = tree_b.query(points)
        target, normal = b.points[nearest], b.normals[nearest]
        changes = np.column_stack([np.cross(points, normal), normal, (points * normal).sum(axis=1)])
        step = np.linalg.lstsq(changes, ((target - points) * normal).sum(axis=1), rcond=WEAK)[0]
        turn = Rotation.from_rotvec(step[:3]).as_matrix() * np.clip(1 + step[6], LEAST, MOST)
        M, t = turn @ M, turn @ t + step[3:6]
    return M, t


def _off_plane(points: np.ndarray, surface: Surface, tree: cKDTree) -> np.ndarray:
    """(n,): how far points (n, 3) lie from the plane of the surface at its nearest point."""
    _, nearest = tree.query(points)
    return np.abs(((points - surface.points[nearest]) * surface.normals[nearest]).sum(axis=1))
