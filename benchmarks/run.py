"""`make bench`: what the shortcuts of labelling save, as ratios within one run.

Attempts on generated objects, once as labelling makes them (culling, early stops) and once as the reference does (every
attempt stepped to the end), and how often the two agree.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from graspfn.geometry import grid
from graspfn.geometry.transforms import apply
from graspfn.meshes.placed import RESTING
from graspfn.params import read_yaml, validate
from graspfn.physics.attempt import Grasper, Outcome
from graspfn.physics.culling import touches_nothing
from graspfn.physics.settling import settle
from graspfn.physics.world import GraspWorld
from graspfn.selection import procedural
from graspfn.selection.collision import collision_mesh

CATEGORIES = ("bottle", "chair", "hammer", "cup")
ATTEMPTS = 20  # of each object, among those that are neither culled nor start inside it


def attempts_on(category: str, seed: int) -> tuple[float, float, int, int]:
    """Seconds as labelled and as the reference, outcomes that agree, attempts made."""
    params = validate(read_yaml(Path("params.yaml")))
    rng = np.random.default_rng(seed)
    mesh = procedural.generate(category, rng)
    mesh.apply_scale(0.12 / mesh.extents.max())
    mesh.apply_translation(-mesh.center_mass)
    settled = settle(mesh, params.physics, params.settle, rng)
    if settled.status != RESTING:
        return 0.0, 0.0, 0, 0
    collision = collision_mesh(mesh, params.meshes.collision_faces, params.meshes.collision_tolerance_mm / 1e3)
    world = GraspWorld(mesh, collision, params.physics, params.gripper)
    grasper = Grasper(world, settled.T_world_object, params.attempt)
    q = grid.sample_cells(1, rng).reshape(-1, 3)
    footprint = apply(settled.T_world_object, mesh.vertices)[:, :2]
    q = rng.permutation(q[~touches_nothing(footprint, q, grasper.world.kinematics)])
    seconds, outcomes = [0.0, 0.0], []
    for pose in q:
        started = time.perf_counter()
        early = grasper.run(pose)
        if early is Outcome.COLLIDED:
            continue
        middle = time.perf_counter()
        whole = grasper.run(pose, whole=True)
        seconds[0] += middle - started
        seconds[1] += time.perf_counter() - middle
        outcomes.append((early is Outcome.HELD) == (whole is Outcome.HELD))
        if len(outcomes) == ATTEMPTS:
            break
    return seconds[0], seconds[1], sum(outcomes), len(outcomes)


def main() -> None:
    print(f"{'object':10} {'ms/attempt':>10} {'reference':>10} {'ratio':>6} {'agree':>6}")
    total = np.zeros(4)
    for seed, category in enumerate(CATEGORIES):
        row = np.array(attempts_on(category, seed))
        total += row
        _print(category, row)
    _print("all", total)


def _print(name: str, row: np.ndarray) -> None:
    early, whole, agree, made = row
    if made:
        ratio, share = whole / early, agree / made
        print(f"{name:10} {early / made * 1e3:10.1f} {whole / made * 1e3:10.1f} {ratio:6.1f} {share:6.2f}")


if __name__ == "__main__":
    main()
