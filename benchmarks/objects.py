"""What the benchmarks grasp: Bullet's random objects at rest, as the workflow itself draws and settles them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import trimesh

import graspfn.physics
from graspfn.geometry import grid
from graspfn.meshes.placed import RESTING, Resting
from graspfn.params import Params, Physics, Settle, read_yaml, validate
from graspfn.physics.attempt import Grasper, Outcome
from graspfn.physics.culling import touches_nothing
from graspfn.physics.gripper import Kinematics
from graspfn.physics.settling import Settled, settle
from graspfn.physics.world import Rig
from graspfn.seeds import generator
from graspfn.selection.selection import select
from graspfn.workflow.files import read_npz, write_npz
from graspfn.workflow.parallel import map_in_order
from graspfn.workflow.shards import code_digest, shard_key, shard_path

T = TypeVar("T")
SPARE = 1.2  # objects drawn for each that is wanted: some never come to rest
ROOM = Path(graspfn.physics.__file__).parent
SETTLING = [ROOM / file for file in ("settling.py", "world.py", "bodies.py")]
NUDGE = np.array([1e-4, 1e-4, np.radians(0.1)])  # a move of a pose that no outcome should depend on: m, m, rad
NOT_SIMULATED = (Outcome.COLLIDED, Outcome.UNTOUCHED)


def committed() -> Params:
    """params.yaml of the working directory."""
    return validate(read_yaml(Path("params.yaml")))


def rig_of(params: Params) -> Rig:
    return Rig(params.physics, params.gripper, params.attempt)


def results_of(
    function: Callable[..., T], tasks: Sequence[tuple[Any, ...]], workers: int, label: str
) -> Iterator[T | Exception]:
    """`function(*arguments)` of every task, or why there is none, in the order of the tasks, as stages have it done."""
    compute = replace(committed().compute, address=None, workers=workers)
    named = [(str(i), arguments) for i, arguments in enumerate(tasks)]
    return (result for _, result in map_in_order(function, named, len(tasks), compute, label))


def finished(names: Iterable[str], results: Iterable[T | Exception]) -> Iterator[tuple[str, T]]:
    """Name and result of every task that gave one; the others are told."""
    for name, result in zip(names, results, strict=True):
        if isinstance(result, Exception):
            print(f"left out {name}: {result}")
        else:
            yield name, result


def resting_objects(params: Params, count: int, workers: int) -> list[tuple[str, Resting]]:
    """The first `count` objects of source random_urdfs that come to rest, and their ids; kept in .scratch/."""
    code = code_digest("meshes", "selection")
    key = shard_key(count, params.meshes, params.seed, params.physics, params.settle, code, *SETTLING, Path(__file__))
    path = shard_path("benchmarks", key)
    if not path.exists():
        write_npz(path, _packed(_drawn(params, count, workers)))
    arrays = read_npz(path)
    return [(str(name), _unpacked(arrays, i)) for i, name in enumerate(arrays["names"])]


def _drawn(params: Params, count: int, workers: int) -> list[tuple[str, Resting]]:
    many = round(count * SPARE) + 1
    drawn = list(select(replace(params.meshes, source="random_urdfs", train=many, test=1), params.seed).train)
    tasks = [(str(one.row["id"]), one.mesh, params.physics, params.settle, params.seed) for one in drawn]
    found = []
    for one, settled in zip(drawn, results_of(_settled, tasks, workers, "settle"), strict=True):
        if isinstance(settled, Exception) or settled.status != RESTING:
            print(f"left out {one.row['id']}: {settled if isinstance(settled, Exception) else settled.status}")
        else:
            found.append((str(one.row["id"]), Resting(one.mesh, one.collision, settled.T_world_object)))
    if len(found) < count:
        raise ValueError(f"{len(found)} of {len(drawn)} objects came to rest, {count} wanted; raise SPARE")
    return found[:count]


def _settled(name: str, mesh: trimesh.Trimesh, physics: Physics, settling: Settle, seed: int) -> Settled:
    return settle(mesh, physics, settling, generator(seed, "place_objects", name))


def _packed(objects: Sequence[tuple[str, Resting]]) -> dict[str, np.ndarray]:
    arrays = {"names": np.array([name for name, _ in objects])}
    for i, (_, resting) in enumerate(objects):
        arrays[f"{i}_T"] = resting.T_world_object
        for part, mesh in (("mesh", resting.mesh), ("collision", resting.collision)):
            arrays[f"{i}_{part}_vertices"], arrays[f"{i}_{part}_faces"] = np.array(mesh.vertices), np.array(mesh.faces)
    return arrays


def _unpacked(arrays: dict[str, np.ndarray], i: int) -> Resting:
    mesh, collision = (
        trimesh.Trimesh(arrays[f"{i}_{part}_vertices"], arrays[f"{i}_{part}_faces"], process=False)
        for part in ("mesh", "collision")
    )
    return Resting(mesh, collision, arrays[f"{i}_T"])


def unculled(resting: Resting, rig: Rig, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """One draw in every cell of Q, in random order: (n, 3) poses that are not culled, and (m, 3) that are."""
    q = rng.permutation(grid.sample_cells(1, rng).reshape(-1, 3))
    culled = touches_nothing(resting, q, Kinematics.from_params(rig.gripper))
    return q[~culled], q[culled]


def touching(resting: Resting, rig: Rig, count: int, rng: np.random.Generator) -> np.ndarray:
    """(count, 3) random poses of Q that are simulated: not culled, not inside at the start, and touching on the way."""
    grasper = Grasper(resting, rig)
    found: list[np.ndarray] = []
    while len(found) < count:
        for q in unculled(resting, rig, rng)[0]:
            if grasper.run(q).outcome not in NOT_SIMULATED:
                found.append(q)
            if len(found) == count:
                break
    return np.array(found).reshape(-1, 3)
