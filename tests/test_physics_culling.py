"""Culled attempts against a slow reference: the hand shown to the collision detector all through the closing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from physics_params import GRIPPER, JAW, PHYSICS

from graspfn.geometry import grid
from graspfn.geometry.transforms import rotation_z, translation
from graspfn.meshes.placed import Resting
from graspfn.params import Gripper
from graspfn.physics.culling import touches_nothing
from graspfn.physics.gripper import Kinematics
from graspfn.physics.world import GraspWorld

# Upright prisms: there a hand touches something exactly where its outline overlaps that of what is so high. All are
# thinner than a finger, so that no finger is inside without meeting a surface.
FOOT = trimesh.creation.box([0.08, 0.05, 0.009], trimesh.transformations.translation_matrix([0, 0, 0.0045]))
POST = trimesh.creation.box([0.009, 0.006, 0.17], trimesh.transformations.translation_matrix([0.0355, 0.022, 0.094]))
LOW = Resting(FOOT, FOOT, rotation_z(0.4) @ translation(0.01, 0.02))
STAND = trimesh.util.concatenate([FOOT, POST])
TALL = Resting(STAND, STAND, rotation_z(0.4) @ translation(0.01, 0.02))
ROD = trimesh.creation.box([0.24, 0.008, 0.008])  # leaning: higher up it stands over another part of the table
LEANING = Resting(ROD, ROD, translation(0, 0, 0.1) @ trimesh.transformations.rotation_matrix(0.9, [0.3, 1, 0]))
GRIPPERS = pytest.mark.parametrize("gripper", [GRIPPER, JAW], ids=["revolute", "prismatic"])


def near_poses(count: int) -> np.ndarray:
    rng = np.random.default_rng(4)
    q = grid.sample_cells(1, rng).reshape(-1, 3)
    return rng.permutation(q[np.hypot(q[:, 0], q[:, 1]) < 0.15])[:count]


def touched(resting: Resting, q: np.ndarray, gripper: Gripper) -> np.ndarray:
    """Whether the hand meets the object at any of many positions of the fingers; (m, 3) -> (m,)."""
    world = GraspWorld(resting, PHYSICS, gripper)
    world.place_object(resting.T_world_object)
    positions = np.linspace(world.kinematics.open, world.kinematics.closed, 40)

    def meets(position: float) -> bool:
        world.hand.setPositions([0.0, position, position])
        return world.hand_touches_object()

    found = []
    for pose in q:
        world.place_hand(pose)
        found.append(any(meets(position) for position in positions))
    return np.array(found)


@GRIPPERS
@pytest.mark.parametrize("resting", [LOW, TALL], ids=["low", "tall"])
def test_upright_prisms_are_culled_exactly_where_nothing_touches(resting: Resting, gripper: Gripper) -> None:
    q = near_poses(400)
    culled = touches_nothing(resting, q, Kinematics.from_params(gripper))
    assert 0.1 < culled.mean() < 0.9
    assert (culled != touched(resting, q, gripper)).all()


@GRIPPERS
def test_culled_attempts_touch_nothing_of_a_leaning_rod(gripper: Gripper) -> None:
    q = near_poses(400)
    culled = q[touches_nothing(LEANING, q, Kinematics.from_params(gripper))]
    assert len(culled) > 40
    assert not touched(LEANING, culled, gripper).any()


@GRIPPERS
def test_the_palm_alone_keeps_an_attempt_from_being_culled(gripper: Gripper) -> None:
    q = near_poses(2000)
    whole = Kinematics.from_params(gripper)
    fingers = Kinematics.from_params(replace(gripper, palm_length_mm=1e-3, palm_width_mm=1e-3))
    assert (touches_nothing(TALL, q, fingers) & ~touches_nothing(TALL, q, whole)).sum() > 20  # the post meets it
    assert (touches_nothing(LOW, q, fingers) == touches_nothing(LOW, q, whole)).all()  # nothing is as high


def test_a_tip_that_just_reaches_the_palm_is_seen() -> None:
    k = Kinematics.from_params(GRIPPER)
    spike = trimesh.convex.convex_hull([[0, 0, k.height + 1e-9], [1e-3, 0, 0], [-1e-3, 1e-3, 0], [-1e-3, -1e-3, 0]])
    resting = Resting(spike, spike, translation(0, 0))
    q = np.array([[0.0, 0.024, 0.0], [0.0, 0.026, 0.0]])  # the palm is 50 mm wide, the fingers 20 mm
    assert touches_nothing(resting, q, k).tolist() == [False, True]
