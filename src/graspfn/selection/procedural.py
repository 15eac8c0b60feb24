"""Objects made on the spot: no download, endless, every one different and reproducible from its generator."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np
import trimesh
from manifold3d import Manifold

from graspfn.selection import electronics, furniture, instruments, plants, things, vehicles, vessels
from graspfn.selection.candidate import Candidate, family_side
from graspfn.selection.primitives import to_trimesh

# ModelNet40's names, with the dish and the hammer that the paper shows
CATEGORIES: dict[str, Callable[[np.random.Generator], Manifold]] = {
    "airplane": vehicles.airplane,
    "bathtub": vessels.bathtub,
    "bottle": vessels.bottle,
    "bowl": vessels.bowl,
    "chair": furniture.chair,
    "cone": vessels.cone,
    "cup": vessels.cup,
    "dish": vessels.dish,
    "flower_pot": plants.flower_pot,
    "guitar": instruments.guitar,
    "hammer": things.hammer,
    "keyboard": electronics.keyboard,
    "lamp": vessels.lamp,
    "monitor": electronics.monitor,
    "stool": furniture.stool,
    "table": furniture.table,
    "vase": vessels.vase,
}


def generate(category: str, rng: np.random.Generator) -> trimesh.Trimesh:
    """One closed object of a category, about unit size, z up."""
    return to_trimesh(CATEGORIES[category](rng))


class Procedural:
    """An endless supply that goes round the categories, so that each is as frequent as the next."""

    name = "procedural"
    count = math.inf

    def candidates(self, split: str, seed: int, by: str) -> Iterator[Candidate]:
        """Names like cup-0004; training objects have even numbers, test objects odd ones. A family is a category."""
        own = family_side(CATEGORIES, split, seed, self.name) if by == "family" else set(CATEGORIES)
        for turn in itertools.count():
            for category in filter(own.__contains__, CATEGORIES):
                name = f"{category}-{2 * turn + (split == 'test'):04d}"
                yield Candidate(f"procedural-{name}", self.name, name, category, category, "MIT")

    def load(self, candidate: Candidate, rng: np.random.Generator) -> trimesh.Trimesh:
        """The object of a name; all that makes it differ from its kin comes from `rng`."""
        return generate(candidate.category, rng)
