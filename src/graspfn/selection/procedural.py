"""Objects made on the spot: no download, endless, every one different and reproducible from its generator."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np
import trimesh
from manifold3d import Manifold

from graspfn.selection import (
    building,
    cabinets,
    electronics,
    fittings,
    furniture,
    instruments,
    plants,
    things,
    upholstery,
    vehicles,
    vessels,
)
from graspfn.selection.candidate import Candidate, family_side
from graspfn.selection.primitives import to_trimesh

# ModelNet40's names, with the dish and the hammer that the paper shows
CATEGORIES: dict[str, Callable[[np.random.Generator], Manifold]] = {
    "airplane": vehicles.airplane,
    "bathtub": vessels.bathtub,
    "bed": upholstery.bed,
    "bench": furniture.bench,
    "bookshelf": cabinets.bookshelf,
    "bottle": vessels.bottle,
    "bowl": vessels.bowl,
    "car": vehicles.car,
    "chair": furniture.chair,
    "cone": vessels.cone,
    "cup": vessels.cup,
    "curtain": building.curtain,
    "desk": cabinets.desk,
    "dish": vessels.dish,
    "door": building.door,
    "dresser": cabinets.dresser,
    "flower_pot": plants.flower_pot,
    "glass_box": things.glass_box,
    "guitar": instruments.guitar,
    "hammer": things.hammer,
    "keyboard": electronics.keyboard,
    "lamp": vessels.lamp,
    "laptop": electronics.laptop,
    "mantel": building.mantel,
    "monitor": electronics.monitor,
    "night_stand": cabinets.night_stand,
    "person": things.person,
    "piano": instruments.piano,
    "plant": plants.plant,
    "radio": electronics.radio,
    "range_hood": fittings.range_hood,
    "sink": fittings.sink,
    "sofa": upholstery.sofa,
    "stairs": building.stairs,
    "stool": furniture.stool,
    "table": furniture.table,
    "tent": building.tent,
    "toilet": fittings.toilet,
    "tv_stand": cabinets.tv_stand,
    "vase": vessels.vase,
    "wardrobe": cabinets.wardrobe,
    "xbox": electronics.xbox,
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
