"""Telling shapes apart whatever their size, place, orientation, handedness and triangles.

A signature is eleven integrals over the surface of a mesh and over that of its convex hull, in units of the hull's
size: subdividing changes none of them, and simplifying a dense mesh to a quarter of its faces changes them by less
than TOLERANCE, which is less than sets a tennis ball apart from an apple, though not from a golf ball.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import trimesh

TOLERANCE = 0.01  # two signatures closer than this in every number are of one shape
LENGTH = 11
DIGITS = 9  # kept: what lies below differs from one processor to another, and so would all that is cached after it
SMALLEST = 1e-6  # a sheet has no thickness, and no logarithm of it

# Weights and barycentric coordinates of a rule that is exact to the fourth degree on a triangle (Dunavant, 1985).
_RULE = [
    (weight, corner)
    for weight, a, b in (
        (0.223381589678011, 0.108103018168070, 0.445948490915965),
        (0.109951743655322, 0.816847572980459, 0.091576213509771),
    )
    for corner in ((a, b, b), (b, a, b), (b, b, a))
]


def signature(mesh: trimesh.Trimesh) -> np.ndarray:
    """(11,) float64: of surface and hull the logarithms of three radii of gyration, of the root of the area and of the
    fourth moment; and how far their centroids lie apart. Any unit of length."""
    hull = mesh.convex_hull
    size = hull.volume ** (1 / 3)
    middle = hull.vertices.mean(axis=0)  # far from the origin the integrals would lose digits
    surface, around = ((body.triangles - middle) / size for body in (mesh, hull))
    (radii, scale, centre), (hull_radii, hull_scale, hull_centre) = _integrals(surface), _integrals(around)
    logs = np.log(np.maximum(np.concatenate([radii, scale, hull_radii, hull_scale]), SMALLEST))
    return np.append(logs, np.linalg.norm(centre - hull_centre)).round(DIGITS)


def _integrals(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of triangles (n, 3, 3): principal radii of gyration (3,), root of area and fourth moment (2,), centroid (3,)."""
    areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1) / 2
    total = areas.sum()
    weights = areas / total
    centroid = weights @ triangles.mean(axis=1)
    second, fourth = np.zeros((3, 3)), 0.0
    for weight, corner in _RULE:
        points = np.einsum("nkd,k->nd", triangles, corner) - centroid
        second += weight * np.einsum("n,ni,nj->ij", weights, points, points)
        fourth += weight * float(weights @ (points**2).sum(axis=1) ** 2)
    radii = np.sqrt(np.maximum(np.linalg.eigvalsh(second), 0))
    return radii, np.array([total**0.5, fourth**0.25]), centroid


@dataclass
class Shapes:
    """The shapes of objects drawn so far, for finding the copies among those to come."""

    ids: list[str] = field(default_factory=list)
    _known: np.ndarray = field(default_factory=lambda: np.empty((0, LENGTH)))

    def distances(self, wanted: np.ndarray) -> np.ndarray:
        """(n,): how far the signature of each known shape lies from this one (11,), in the number that differs most."""
        return np.abs(self._known - wanted).max(axis=1)

    def like(self, wanted: np.ndarray) -> str | None:
        """The id of the nearest object of the same shape, if there is one."""
        if not self.ids:
            return None
        distance = self.distances(wanted)
        nearest = int(distance.argmin())
        return self.ids[nearest] if distance[nearest] < TOLERANCE else None

    def add(self, object_id: str, found: np.ndarray) -> None:
        self.ids.append(object_id)
        self._known = np.vstack([self._known, found])
