"""Where meshes come from, by the name that `meshes.source` gives.

A further source is one more file and one entry here.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import numpy as np
import trimesh

from graspfn.meshes.folder import Folder
from graspfn.meshes.procedural import Procedural
from graspfn.params import Meshes


class Source(Protocol):
    """A supply of meshes, each with a name that says which it is."""

    name: str
    count: float  # meshes it holds; infinite where it makes them

    def candidates(self, split: str, seed: int) -> Iterator[tuple[str, str]]:
        """(name, class) in the order in which "train" or "test" draws them, whatever number is wanted.

        A finite source lets both splits see all it has, from opposite ends, so that they meet only once it is used up.
        """
        ...

    def load(self, name: str, rng: np.random.Generator) -> trimesh.Trimesh:
        """One mesh, in its own units; whatever it draws, it draws from `rng`."""
        ...

    def id(self, name: str, shape: str) -> str:
        """The id of an object: a file name's worth of letters; `shape` is the fingerprint of its mesh."""
        ...


def source_of(meshes: Meshes) -> Source:
    """The source that the parameters name."""
    if meshes.source == "folder":
        assert meshes.folder is not None  # params.validate
        return Folder(Path(meshes.folder))
    return Procedural()
