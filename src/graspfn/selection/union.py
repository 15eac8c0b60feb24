"""Several sources drawn as one."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import trimesh

from graspfn.selection.candidate import Candidate, Source, shuffled


class Union:
    """Finite sources shuffled together, by turns with an endless one, which goes on alone when they are used up.

    So both splits have the same mix, however large they are, while the finite ones last.
    """

    count = math.inf

    def __init__(self, name: str, finite: list[Source], endless: Source):
        self.name = name
        self.finite, self.endless = finite, endless
        self._sources = {source.name: source for source in (*finite, endless)}

    def candidates(self, split: str, seed: int, by: str) -> Iterator[Candidate]:
        """Each source deals its own families, so that two that share a family's name do not matter."""
        pool = (candidate for source in self.finite for candidate in source.candidates(split, seed, by))
        others = self.endless.candidates(split, seed, by)
        for candidate in shuffled(pool, split, seed, by):
            yield candidate
            yield next(others)
        yield from others

    def load(self, candidate: Candidate, rng: np.random.Generator) -> trimesh.Trimesh:
        return self._sources[candidate.source].load(candidate, rng)
