"""A mesh on offer, what offers it, and the order in which the two splits take them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import trimesh

from graspfn.meshes.errors import MeshError
from graspfn.seeds import seed_of


@dataclass(frozen=True)
class Candidate:
    """A mesh that a source offers, before it is read."""

    id: str  # of the object that it would become, a file name's worth of letters: ycb-025_mug
    source: str  # ycb
    name: str  # which of the source's meshes: 025_mug
    category: str  # its class: mug; "" where unknown
    family: str  # what a split by family keeps on one side: kitchen
    licence: str


class Source(Protocol):
    """A supply of meshes."""

    name: str
    count: float  # meshes it holds; infinite where it makes them

    def candidates(self, split: str, seed: int, by: str) -> Iterator[Candidate]:
        """In the order in which "train" or "test" takes them, whatever number is wanted.

        by "shape", a finite source lets both splits see all it has, from opposite ends, so that they meet only once it
        is used up; by "family", each split sees its own families alone. MeshError where that cannot be done.
        """
        ...

    def load(self, candidate: Candidate, rng: np.random.Generator) -> trimesh.Trimesh:
        """One mesh in the source's own units, metres where it states one; whatever it draws, it draws from `rng`.

        Raises RejectedMeshError for a file that cannot be read.
        """
        ...


def order(candidates: Iterable[Candidate], split: str, seed: int, by: str) -> list[Candidate]:
    """What a split takes of a finite source, first things first. MeshError where two meshes would have one id."""
    pool = list(candidates)
    names: dict[str, str] = {}  # some file systems tell no capitals
    for candidate in pool:
        twin = names.setdefault(candidate.id.lower(), candidate.name)
        if twin != candidate.name:
            raise MeshError(f"{candidate.source}: {twin} and {candidate.name} would both be {candidate.id}; rename one")
    if by == "family":
        own = family_side((candidate.family for candidate in pool), split, seed, pool[0].source)
        pool = [candidate for candidate in pool if candidate.family in own]
    return shuffled(pool, split, seed, by)


def shuffled(pool: Iterable[Candidate], split: str, seed: int, by: str) -> list[Candidate]:
    """An order drawn from the seed, that one candidate more or less leaves as it is; test's backwards by shape."""
    backwards = split == "test" and by == "shape"
    return sorted(pool, key=lambda candidate: seed_of(seed, "select_meshes", candidate.id), reverse=backwards)


def family_side(families: Iterable[str], split: str, seed: int, source: str) -> set[str]:
    """The families of a split: every other one in an order drawn from the seed, train's first."""
    drawn = sorted(set(families), key=lambda family: seed_of(seed, "select_meshes", "family", family))
    if len(drawn) < 2:
        raise MeshError(f"meshes.split: family takes meshes of two families or more; {source} has {drawn} alone")
    return set(drawn[split == "test" :: 2])


def as_id(text: str) -> str:
    """A file name's worth of letters."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", text)
