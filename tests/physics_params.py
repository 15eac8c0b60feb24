"""The committed gripper and physics, a parallel jaw, and poses to try, for tests that build worlds of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from graspfn.compose import compose
from graspfn.geometry import grid
from graspfn.meshes.placed import Resting
from graspfn.params import read_yaml, validate
from graspfn.physics.culling import touches_nothing
from graspfn.physics.world import GraspWorld

ROOT = Path(__file__).parents[1]
PARAMS = validate(read_yaml(ROOT / "params.yaml"))
PHYSICS, GRIPPER, ATTEMPT, SETTLE = PARAMS.physics, PARAMS.gripper, PARAMS.attempt, PARAMS.settle
_JAW = validate(compose(["gripper=franka_hand"], ROOT / "conf"))
JAW, JAW_ATTEMPT = _JAW.gripper, _JAW.attempt


def touching_poses(resting: Resting, count: int) -> np.ndarray:
    """(count, 3) poses at which the open hand is clear of the object and may meet it as it closes or rises."""
    rng = np.random.default_rng(3)
    q = grid.sample_cells(3, rng).reshape(-1, 3)
    world = GraspWorld(resting, PHYSICS, GRIPPER)
    world.place_object(resting.T_world_object)
    clear: list[np.ndarray] = []
    for pose in rng.permutation(q[~touches_nothing(resting, q, world.kinematics)]):
        world.place_hand(pose)
        if not world.hand_touches_object() and not world.hand_inside_object():
            clear.append(pose)
        if len(clear) == count:
            return np.array(clear)
    raise ValueError(f"{len(clear)} poses, {count} asked for")
