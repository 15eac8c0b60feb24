"""Grasp attempts at every pose of Q of one object (paper III-C)."""

from __future__ import annotations

import functools
import gc
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from graspfn.geometry import grid
from graspfn.geometry.transforms import apply
from graspfn.params import Attempt, Gripper, Physics
from graspfn.physics.attempt import Grasper, Outcome
from graspfn.physics.culling import touches_nothing
from graspfn.physics.world import GraspWorld

CULLED = "culled"
ALL = slice(None)


@dataclass(frozen=True)
class Labels:
    """The grasp function of one object, counted.

    successes: (33, 44, 6) uint8, attempts that held at each pose.
    account: how each of the 8712 x attempts ended, by name; `culled` ones provably touch nothing and were not
    simulated, nor were `collided` ones, which start inside the object.
    """

    successes: np.ndarray
    account: dict[str, int]


def label_object(
    mesh: trimesh.Trimesh,
    collision: trimesh.Trimesh,
    T_world_object: np.ndarray,
    attempts: int,
    physics: Physics,
    gripper: Gripper,
    attempt: Attempt,
    rng: np.random.Generator,
    angles: slice = ALL,
) -> Labels:
    """Attempt `attempts` grasps in the cell of every pose of Q; meshes in metres, resting at T_world_object (4, 4).

    `angles` picks some of Q's angles: labels of an object may be made in parts, which `joined` puts together.
    """
    _freeze_imports()
    world = GraspWorld(mesh, collision, physics, gripper)
    grasper = Grasper(world, T_world_object, attempt)
    draws = grid.sample_cells(attempts, rng)[:, :, angles]
    q = draws.reshape(-1, 3)
    culled = touches_nothing(apply(T_world_object, mesh.vertices)[:, :2], q, world.kinematics)
    held = np.zeros(len(q), dtype=bool)
    outcomes = [outcome for outcome in Outcome if outcome is not Outcome.UNTOUCHED]
    account = Counter({CULLED: int(culled.sum())} | {outcome.value: 0 for outcome in outcomes})
    for i in np.flatnonzero(~culled):
        outcome = grasper.run(q[i])
        held[i] = outcome is Outcome.HELD
        account[CULLED if outcome is Outcome.UNTOUCHED else outcome.value] += 1
    successes = held.reshape(draws.shape[:-1]).sum(axis=-1).astype(np.uint8)
    return Labels(successes, dict(account))


@functools.cache
def _freeze_imports() -> None:
    """The collector would walk every imported module again and again: a tenth of the time."""
    gc.collect()
    gc.freeze()


def joined(parts: Sequence[Labels]) -> Labels:
    """The labels of an object from those of its angles, in order."""
    account = sum((Counter(part.account) for part in parts), Counter(dict.fromkeys(parts[0].account, 0)))
    names = parts[0].account
    return Labels(np.concatenate([part.successes for part in parts], axis=2), {name: account[name] for name in names})
