"""Drawing the objects to train on and other objects to test on, and giving each a size (paper III and V)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import trimesh

from graspfn.meshes.cleaning import clean, fingerprint, solid
from graspfn.meshes.errors import MeshError, RejectedMeshError
from graspfn.meshes.sources import Source, source_of
from graspfn.params import Meshes
from graspfn.workflow.seeds import generator

Row = dict[str, Any]


@dataclass
class Selection:
    """Objects of both splits, made one at a time as they are asked for, and the meshes that were turned down.

    Object i of a split is the same whatever the counts are, so that raising them keeps every label already made.
    (Where one shape has two files, the split that is drawn first keeps it: draw train first.)
    """

    meshes: Meshes
    seed: int
    source: Source
    rejects: list[Row] = field(default_factory=list)  # split, name, reason
    _names: dict[str, str] = field(default_factory=dict)  # name: the split that drew it
    _shapes: dict[str, str] = field(default_factory=dict)  # fingerprint: name

    @property
    def train(self) -> Iterator[tuple[Row, trimesh.Trimesh]]:
        return self._draw("train", self.meshes.train)

    @property
    def test(self) -> Iterator[tuple[Row, trimesh.Trimesh]]:
        return self._draw("test", self.meshes.test)

    def _draw(self, split: str, wanted: int) -> Iterator[tuple[Row, trimesh.Trimesh]]:
        """`wanted` objects of a split as (row of the manifest, mesh in metres about its centre of mass)."""
        found = 0
        for index, (name, category) in enumerate(self.source.candidates(split, self.seed)):
            if found == wanted:
                return
            if self._names.setdefault(name, split) != split:
                break  # the other split came this far from the other end
            try:
                row, mesh = self._object(name, category)
            except RejectedMeshError as reason:
                self.rejects.append({"split": split, "name": name, "reason": str(reason)})
                continue
            found += 1
            yield row | {"seed_index": index}, mesh
        if found < wanted:
            raise MeshError(self._too_few(f"{found} of {wanted} {split} objects found"))

    def _object(self, name: str, category: str) -> tuple[Row, trimesh.Trimesh]:
        """One mesh loaded, cleaned, scaled and centred."""
        raw = self.source.load(name, generator(self.seed, "select_meshes", f"{self.source.name}-{name}"))
        mesh, cleaning = clean(raw)
        shape = fingerprint(mesh)
        if self._shapes.setdefault(shape, name) != name:
            raise RejectedMeshError(f"the same shape as {self._shapes[shape]}")
        object_id = self.source.id(name, shape)
        size = generator(self.seed, "select_meshes", object_id, "size").uniform(
            self.meshes.size_min_cm / 100, self.meshes.size_max_cm / 100
        )
        scale = size / float(mesh.extents.max())
        mesh = _placed(mesh, scale)
        row = {
            "id": object_id,
            "source": self.source.name,
            "name": name,
            "class": category,
            "scale": scale,
            "size_m": float(mesh.extents.max()),
            "volume_m3": float(solid(mesh).volume),
            "watertight": bool(mesh.is_watertight),
            "faces": len(mesh.faces),
            "cleaning": cleaning,
        }
        return row, mesh

    def _too_few(self, found: str) -> str:
        asked = f"meshes.train + meshes.test = {self.meshes.train} + {self.meshes.test}"
        rejected = f", {len(self.rejects)} rejected (first: {self.rejects[0]['reason']})" if self.rejects else ""
        return (
            f"{self.meshes.folder}: not enough meshes for {asked}: {self.source.count:.0f} files{rejected}, {found};"
            " ask for fewer or add meshes"
        )


def select(meshes: Meshes, seed: int) -> Selection:
    """The objects that the parameters ask for; MeshError at once where the source cannot hold so many."""
    selection = Selection(meshes, seed, source_of(meshes))
    if selection.source.count < meshes.train + meshes.test:
        raise MeshError(selection._too_few("none drawn"))
    return selection


def _placed(mesh: trimesh.Trimesh, scale: float) -> trimesh.Trimesh:
    """The mesh in metres with its centre of mass (the hull's, where it is open) at the origin."""
    # centred before the volume integrals: files may place an object far from their origin
    vertices = (mesh.vertices - mesh.bounds.mean(axis=0)) * scale
    placed = trimesh.Trimesh(vertices, mesh.faces, process=False)
    return trimesh.Trimesh(vertices - solid(placed).center_mass, mesh.faces, process=False)
