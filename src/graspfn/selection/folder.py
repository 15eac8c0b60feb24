"""Meshes of one's own: any directory or zip of files that trimesh reads."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import numpy as np
import trimesh

from graspfn.meshes.errors import printable
from graspfn.selection.candidate import Candidate, as_id, order
from graspfn.selection.files import files_of

SPLITS = ("train", "test")  # ModelNet's own split: folders that are no class


class Folder:
    """Every mesh file under `root`, however deep; its class and family are the folder that holds it."""

    name = "folder"

    def __init__(self, root: Path):
        self.files = files_of(root)
        self._paths = {printable(path): path for path in self.files.names}
        self.count = float(len(self.files.names))

    def candidates(self, split: str, seed: int, by: str) -> Iterator[Candidate]:
        yield from order(map(_candidate, self._paths), split, seed, by)

    def load(self, candidate: Candidate, rng: np.random.Generator) -> trimesh.Trimesh:
        """The mesh of a file; `rng` is not needed, since a file holds one mesh."""
        return self.files.load(self._paths[candidate.name])


def _candidate(name: str) -> Candidate:
    """folder-bed_0001-9f1c22ab: the hash of the path tells files of equal names apart."""
    path = hashlib.blake2b(name.encode(), digest_size=4).hexdigest()
    category = class_of(name)
    object_id = f"folder-{as_id(PurePosixPath(name).stem)}-{path}"
    return Candidate(object_id, "folder", name, category, category, "not stated")


def class_of(name: str) -> str:
    """bed/train/bed_0001.off is a bed; a file that lies in no folder has the class ""."""
    parts = PurePosixPath(name).parts[:-1]
    if parts and parts[-1] in SPLITS:
        parts = parts[:-1]
    return parts[-1] if parts else ""
