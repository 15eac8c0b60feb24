"""Several sources drawn as one."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import trimesh

from graspfn.selection.candidate import Candidate, Source, shuffled


class Union:
    """Finite sources shuffled together and, when they are used up, an endless one."""

    count = math.inf

    def __init__(self, name: str, finite: list[Source], endless: Source):
        self.name = name
        self.finite, self.endless = finite, endless
        self._sources = {source.name: source for source in (*finite, endless)}

    def candidates(self, split: str, seed: int, by: str) -> Iterator[Candidate]:
        """Each source deals its own families, so that two that share a family's name do not matter."""
        pool = (candidate for source in self.finite for candidate in source.candidates(split, seed, by))
        yield from shuffled(pool, split, seed, by)
        yield from self.endless.candidates(split, seed, by)

    def load(self, candidate: Candidate, rng: np.random.Generator) -> trimesh.Trimesh:
        return self._sources[candidate.source].load(candidate, rng)
