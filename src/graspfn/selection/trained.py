"""The objects to train on, whose shapes stay out of the test objects: by signature, then by surface."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import trimesh

from graspfn.selection import signature, surfaces
from graspfn.selection.signature import Shapes
from graspfn.selection.surfaces import Surface

NEAR = 0.06  # signatures this near are worth a look at the surfaces; of one shape are hardly any farther apart
# Of found objects, pairs that nobody would tell apart lie 0.001 to 0.004 apart; boxes of pudding and of gelatine
# 0.0054, an orange and a ball or cups that fit into each other 0.007, an apple and a ball 0.021.
TOLERANCE = 0.0045
DIGITS = 5  # of a distance: what is finer depends on how a machine adds up


@dataclass(frozen=True)
class Nearest:
    """The training object nearest to another. distance: of surfaces, in its sizes; same: the two are of one shape."""

    id: str
    distance: float
    same: bool


@dataclass
class Trained:
    """The objects to train on, as they are drawn."""

    shapes: Shapes = field(default_factory=Shapes)
    _surfaces: list[Surface] = field(default_factory=list)

    def add(self, object_id: str, found: np.ndarray, mesh: trimesh.Trimesh) -> None:
        """Take in an object and its signature (11,)."""
        self.shapes.add(object_id, found)
        self._surfaces.append(surfaces.surface_of(mesh))

    def nearest(self, wanted: np.ndarray, mesh: trimesh.Trimesh) -> Nearest | None:
        """The training object nearest to a mesh with this signature (11,); None where there is none at all.

        Where a signature is the same, the nearest one's; else that of the nearest surface where signatures are near;
        else that of the nearest signature.
        """
        if not self._surfaces:
            return None
        distance = self.shapes.distances(wanted)
        first = int(distance.argmin())
        one = bool(distance[first] < signature.TOLERANCE)
        near = [first] if one or distance[first] >= NEAR else np.flatnonzero(distance < NEAR)
        surface = surfaces.surface_of(mesh)
        gaps = [round(surfaces.gap(surface, self._surfaces[k]), DIGITS) for k in near]
        best = int(np.argmin(gaps))
        return Nearest(self.shapes.ids[near[best]], gaps[best], one or gaps[best] < TOLERANCE)
