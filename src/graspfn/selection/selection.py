"""Drawing the objects to train on and other objects to test on, and giving each a size (paper IV-C, VII)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
import trimesh

from graspfn.meshes.errors import MeshError, RejectedMeshError
from graspfn.meshes.mass import solid
from graspfn.params import Meshes
from graspfn.seeds import generator
from graspfn.selection.candidate import Candidate, Source
from graspfn.selection.cleaning import clean
from graspfn.selection.collision import collision_mesh
from graspfn.selection.signature import Shapes, signature
from graspfn.selection.sources import source_of
from graspfn.selection.trained import Trained
from graspfn.selection.written import Object, Row

IN_VAIN = 200  # meshes turned down one after the other: an endless source would go on for ever
REJECTS = ("split", "source", "name", "class", "reason")

Task = tuple[Candidate, trimesh.Trimesh | RejectedMeshError, Meshes, int]
# map(function, tasks by name, how many are wanted): names and results or exceptions, in the order of the tasks
Map = Callable[[Callable[..., Object], Iterable[tuple[str, Task]], int], Iterable[tuple[str, Object | Exception]]]


def one_by_one(
    function: Callable[..., Object], tasks: Iterable[tuple[str, Task]], wanted: int
) -> Iterator[tuple[str, Object | Exception]]:
    """A Map in this process."""
    for name, arguments in tasks:
        try:
            result: Object | Exception = function(*arguments)
        except Exception as error:
            result = error
        yield name, result


def make_object(candidate: Candidate, raw: trimesh.Trimesh | RejectedMeshError, meshes: Meshes, seed: int) -> Object:
    """A mesh cleaned, scaled so that its largest extent is uniform between the limits, and centred on its mass."""
    if isinstance(raw, Exception):
        raise RejectedMeshError(f"unreadable: {raw}")
    cleaned = clean(raw)
    size = generator(seed, "select_meshes", candidate.id, "size").uniform(
        meshes.size_min_cm / 100, meshes.size_max_cm / 100
    )
    scale = size / float(cleaned.mesh.extents.max())
    mesh, collision = at_scale(cleaned.mesh, scale, meshes)
    row = {
        "id": candidate.id,
        "source": candidate.source,
        "name": candidate.name,
        "class": candidate.category,
        "family": candidate.family,
        "licence": candidate.licence,
        "signature": signature(mesh).tolist(),
        "scale": scale,
        "size_m": float(mesh.extents.max()),
        "volume_m3": float(solid(mesh).volume),
        "mass": cleaned.mass,
        "watertight": bool(mesh.is_watertight),
        "faces": len(mesh.faces),
        "collision_faces": len(collision.faces),
        "cleaning": cleaned.steps,
    }
    return Object(row, mesh, collision)


def at_scale(clean_mesh: trimesh.Trimesh, scale: float, meshes: Meshes) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """The mesh in metres with its centre of mass (the hull's, where it is open) at the origin, and its collision mesh.

    scale: metres to a unit of the clean mesh.
    """
    # centred before the volume integrals: files may place an object far from their origin
    vertices = (clean_mesh.vertices - clean_mesh.bounds.mean(axis=0)) * scale
    placed = trimesh.Trimesh(vertices, clean_mesh.faces, process=False)
    mesh = trimesh.Trimesh(vertices - solid(placed).center_mass, clean_mesh.faces, process=False)
    return mesh, collision_mesh(mesh, meshes.collision_faces, meshes.collision_tolerance_mm / 1e3)


@dataclass
class Selection:
    """Objects of both splits, made as they are asked for, and the meshes that were turned down.

    Draw train first. Object i of a split is the same whatever the counts are, so that raising them keeps every label
    already made; but a test object whose shape a further training object turns out to have gives way to it.
    """

    meshes: Meshes
    seed: int
    source: Source
    map: Map = one_by_one
    rejects: list[Row] = field(default_factory=list)  # with the keys of REJECTS
    _drawn: dict[str, str] = field(default_factory=dict)  # id: the split that drew it
    _trained: Trained = field(default_factory=Trained)
    _tested: Shapes = field(default_factory=Shapes)
    _name_of: dict[str, str] = field(default_factory=dict)  # id of an object: the shape it has

    @property
    def train(self) -> Iterator[Object]:
        return self._draw("train", self.meshes.train)

    @property
    def test(self) -> Iterator[Object]:
        return self._draw("test", self.meshes.test)

    def _draw(self, split: str, wanted: int) -> Iterator[Object]:
        """`wanted` objects of a split."""
        issued: dict[str, tuple[int, Candidate]] = {}

        def tasks() -> Iterator[tuple[str, Task]]:
            for index, candidate in enumerate(self.source.candidates(split, self.seed, self.meshes.split)):
                if self._drawn.get(candidate.id, split) != split:
                    continue  # both splits see all of a finite source
                issued[candidate.id] = index, candidate
                yield candidate.id, (candidate, self._load(candidate), self.meshes, self.seed)

        found = in_vain = 0
        for name, result in self.map(make_object, tasks(), wanted):
            index, candidate = issued.pop(name)
            self._drawn[name] = split
            try:
                drawn = self._accepted(split, name, result)
            except RejectedMeshError as reason:
                values = (split, candidate.source, candidate.name, candidate.category, str(reason))
                self.rejects.append(dict(zip(REJECTS, values, strict=True)))
                in_vain += 1
                if in_vain == IN_VAIN and np.isinf(self.source.count):
                    line = f"meshes.source {self.source.name}: {IN_VAIN} turned down in a row: {reason}"
                    raise MeshError(line) from None
                continue
            found, in_vain = found + 1, 0
            yield Object(drawn.row | {"split": split, "seed_index": index}, drawn.mesh, drawn.collision)
            if found == wanted:
                return
        raise MeshError(self._too_few(f"{found} of {wanted} {split} objects found"))

    def _load(self, candidate: Candidate) -> trimesh.Trimesh | RejectedMeshError:
        try:
            return self.source.load(candidate, generator(self.seed, "select_meshes", candidate.id))
        except RejectedMeshError as reason:
            return reason

    def _accepted(self, split: str, name: str, result: Object | Exception) -> Object:
        """The object with the name of its shape; RejectedMeshError where it is none, or may not be in this split."""
        if isinstance(result, RejectedMeshError):
            raise result
        if isinstance(result, ImportError):
            raise MeshError(f"{name}: {result}; every worker takes this package with all its dependencies") from result
        if isinstance(result, Exception):  # a library's error on a mesh nobody foresaw, or a worker that died of it
            raise RejectedMeshError(f"failed: {type(result).__name__} {' '.join(str(result).split())}") from result
        found = np.array(result.row["signature"])
        nearest = {"nearest": "", "nearest_distance": math.nan}
        if split == "test" and (near := self._trained.nearest(found, result.mesh)):
            if near.same:
                apart = f"surfaces {100 * near.distance:.2f} % of its size apart"
                raise RejectedMeshError(f"copy: it has the shape of {near.id}, which is to train on ({apart})")
            nearest = {"nearest": near.id, "nearest_distance": near.distance}
        twin = (self._trained.shapes if split == "train" else self._tested).like(found)
        if split == "train":
            self._trained.add(name, found, result.mesh)
        else:
            self._tested.add(name, found)
        self._name_of[name] = self._name_of[twin] if twin else name
        return Object(result.row | {"shape": self._name_of[name]} | nearest, result.mesh, result.collision)

    def _too_few(self, found: str) -> str:
        asked = f"meshes.train + meshes.test = {self.meshes.train} + {self.meshes.test}"
        first = self.rejects[0] if self.rejects else None
        rejected = f", {len(self.rejects)} rejected (first {first['name']}: {first['reason']})" if first else ""
        where = f" ({self.meshes.folder})" if self.source.name in ("folder", "modelnet40") else ""
        return (
            f"meshes.source {self.source.name}{where}: not enough meshes for {asked}: {self.source.count:g}"
            f" there{rejected}, {found}; ask for fewer or add meshes"
        )


def select(meshes: Meshes, seed: int, map: Map = one_by_one) -> Selection:
    """The objects that the parameters ask for; MeshError at once where the source cannot hold so many."""
    selection = Selection(meshes, seed, source_of(meshes), map)
    source = selection.source
    if np.isinf(source.count):
        return selection
    if source.count < meshes.train + meshes.test:
        raise MeshError(selection._too_few("none drawn"))
    for split, wanted in (("train", meshes.train), ("test", meshes.test)):
        there = sum(1 for _ in source.candidates(split, seed, meshes.split))
        if there < wanted:
            raise MeshError(selection._too_few(f"{there} to {split} on"))
    return selection
