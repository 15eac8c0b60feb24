"""Convex objects at rest: the same shapes to DART and to MuJoCo."""

from __future__ import annotations

from collections.abc import Iterator

import trimesh
from objects import resting_objects
from trimesh.creation import box, cylinder, icosphere

from graspfn.meshes.placed import RESTING, Resting
from graspfn.params import Params
from graspfn.physics.settling import settle
from graspfn.seeds import generator

TRIES = 10  # orientations in which a hull is dropped: some roll away
SOLIDS = {
    "box": box([0.06, 0.04, 0.03]),
    "cylinder": cylinder(0.02, 0.08),
    "sphere": icosphere(2, 0.025),
    "hexagonal prism": cylinder(0.025, 0.07, sections=6),
}


def convex_objects(params: Params, count: int, workers: int) -> Iterator[tuple[str, Resting]]:
    """The hulls of `count` of Bullet's random objects, and the solids: those that come to rest."""
    hulls = [(name, resting.mesh.convex_hull) for name, resting in resting_objects(params, count, workers)]
    for name, mesh in (*hulls, *SOLIDS.items()):
        resting = _at_rest(mesh, params, name)
        if resting is None:
            print(f"left out {name}: never came to rest")
        else:
            yield name, resting


def _at_rest(mesh: trimesh.Trimesh, params: Params, name: str) -> Resting | None:
    mesh = trimesh.Trimesh(mesh.vertices - mesh.center_mass, mesh.faces, process=False)
    for attempt in range(TRIES):
        settled = settle(mesh, params.physics, params.settle, generator(params.seed, "convex", name, attempt))
        if settled.status == RESTING:
            return Resting(mesh, mesh, settled.T_world_object)
    return None
