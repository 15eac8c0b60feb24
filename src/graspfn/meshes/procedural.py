"""Objects made on the spot: no download, endless, every one different and reproducible from its generator."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np
import trimesh
from manifold3d import Manifold

from graspfn.meshes import furniture, things, vessels
from graspfn.meshes.primitives import to_trimesh

# ModelNet40's names, with the dish and the hammer that the paper shows
CATEGORIES: dict[str, Callable[[np.random.Generator], Manifold]] = {
    "airplane": things.airplane,
    "bathtub": vessels.bathtub,
    "bottle": vessels.bottle,
    "bowl": vessels.bowl,
    "chair": furniture.chair,
    "cone": vessels.cone,
    "cup": vessels.cup,
    "dish": vessels.dish,
    "flower_pot": vessels.flower_pot,
    "guitar": things.guitar,
    "hammer": things.hammer,
    "keyboard": things.keyboard,
    "lamp": vessels.lamp,
    "monitor": things.monitor,
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

    def candidates(self, split: str, seed: int) -> Iterator[tuple[str, str]]:
        """Names like cup-0004; training objects have even numbers, test objects odd ones."""
        for turn in itertools.count():
            for category in CATEGORIES:
                yield f"{category}-{2 * turn + (split == 'test'):04d}", category

    def load(self, name: str, rng: np.random.Generator) -> trimesh.Trimesh:
        """The object of a name; all that makes it differ from its kin comes from `rng`."""
        return generate(name.rpartition("-")[0], rng)

    def id(self, name: str, shape: str) -> str:
        """procedural-cup-0004: the name says it all."""
        return f"procedural-{name}"
