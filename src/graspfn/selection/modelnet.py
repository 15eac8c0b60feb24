"""ModelNet40 (Wu et al. 2015), the paper's meshes: as downloaded, zipped or unpacked."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import numpy as np
import trimesh

from graspfn.meshes.errors import MeshError, printable
from graspfn.selection.candidate import Candidate, as_id, order
from graspfn.selection.files import files_of
from graspfn.selection.folder import SPLITS, class_of

LICENCE = "research use only (modelnet.cs.princeton.edu)"


class ModelNet:
    """The files <class>/{train,test}/<name>.off under `root`, at any depth; a family is a class.

    By shape, ModelNet's own split holds: train draws from the train folders, test from the test folders.
    """

    name = "modelnet40"

    def __init__(self, root: Path):
        self.files = files_of(root)
        self._paths: dict[str, str] = {}  # by name: bed_0001
        for path in filter(_in_layout, self.files.names):
            name = printable(PurePosixPath(path).stem)
            twin = self._paths.setdefault(name, path)
            if twin != path:
                raise MeshError(f"{root}: {name} twice, {twin} and {path}; meshes=modelnet40 takes each name once")
        if not self._paths:
            raise MeshError(f"{root}: no <class>/train/*.off in it; meshes=modelnet40 takes ModelNet40, zipped or not")
        self.count = float(len(self._paths))

    def candidates(self, split: str, seed: int, by: str) -> Iterator[Candidate]:
        drawn = [path for path in self._paths.values() if by == "family" or PurePosixPath(path).parent.name == split]
        yield from order(map(_candidate, drawn), split, seed, by)

    def load(self, candidate: Candidate, rng: np.random.Generator) -> trimesh.Trimesh:
        """The mesh of a file; `rng` is not needed, since a file holds one mesh."""
        return self.files.load(self._paths[candidate.name])


def _in_layout(path: str) -> bool:
    name = PurePosixPath(path)
    return name.suffix.lower() == ".off" and name.parent.name in SPLITS and class_of(path) != ""


def _candidate(path: str) -> Candidate:
    name, category = printable(PurePosixPath(path).stem), printable(class_of(path))
    return Candidate(f"modelnet40-{as_id(name)}", "modelnet40", name, category, category, LICENCE)
