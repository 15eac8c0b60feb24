"""The grippers' kinematics and the force they grip with, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from physics_params import ATTEMPT, GRIPPER, JAW, JAW_ATTEMPT, PHYSICS

from graspfn.geometry import grid
from graspfn.geometry.transforms import T_world_grasp, translation
from graspfn.meshes.placed import Resting
from graspfn.params import Gripper, ParameterError
from graspfn.physics.attempt import Grasper
from graspfn.physics.gripper import Kinematics
from graspfn.physics.labelling import OUTCOMES, label_object
from graspfn.physics.world import GraspWorld, Rig

GRIPPERS = pytest.mark.parametrize("gripper", [GRIPPER, JAW], ids=["revolute", "prismatic"])
LOOSE, LOOSE_JAW = replace(GRIPPER, gear_friction_nm=0.0), replace(JAW, drive_friction_n=0.0)
HIGH, LOW = 0.06, 0.04  # blocks that fit under the palms


def finger_corners(k: Kinematics, position: float) -> list[np.ndarray]:
    """Corners (8, 3) of left and right finger in the hand's frame."""
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).T.reshape(-1, 3) / 2
    return [signs * size @ T[:3, :3].T + T[:3, 3] for T, size in k.parts((position, position))[1:]]


def closing(k: Kinematics) -> list[np.ndarray]:
    """Corners of the right finger at many positions from open to closed."""
    return [finger_corners(k, position)[1] for position in np.linspace(k.open, k.closed, 500)]


@GRIPPERS
def test_open_fingertips_are_the_opening_apart(gripper: Gripper) -> None:
    k = Kinematics.from_params(gripper)
    left, right = finger_corners(k, k.open)
    inner_tips = [corners[np.argsort(corners[:, 2])[:4]] for corners in (left, right)]
    gap = inner_tips[1][:, 0].min() - inner_tips[0][:, 0].max()
    assert gap == pytest.approx(gripper.opening_mm / 1e3, abs=1e-9)


@GRIPPERS
def test_closed_fingertips_meet(gripper: Gripper) -> None:
    k = Kinematics.from_params(gripper)
    left, right = finger_corners(k, k.closed)
    assert left[:, 0].max() == pytest.approx(0, abs=1e-9)
    assert right[:, 0].min() == pytest.approx(0, abs=1e-9)


@GRIPPERS
def test_lowest_point_of_the_closing_is_the_clearance(gripper: Gripper) -> None:
    lowest = min(corners[:, 2].min() for corners in closing(Kinematics.from_params(gripper)))
    assert lowest == pytest.approx(gripper.clearance_mm / 1e3, abs=1e-6)


@GRIPPERS
def test_no_point_of_the_closing_is_beyond_the_reach(gripper: Gripper) -> None:
    k = Kinematics.from_params(gripper)
    assert max(corners[:, 0].max() for corners in closing(k)) == pytest.approx(k.reach(), abs=1e-9)


@GRIPPERS
def test_fingers_mirror_each_other(gripper: Gripper) -> None:
    k = Kinematics.from_params(gripper)
    left, right = finger_corners(k, k.open + 0.7 * (k.closed - k.open))
    mirrored = left * [-1, 1, 1]
    assert {tuple(p) for p in np.round(mirrored, 9)} == {tuple(p) for p in np.round(right, 9)}


def test_a_parallel_jaws_pads_stay_upright_and_as_high() -> None:
    k = Kinematics.from_params(JAW)
    sizes = np.array([JAW.finger_thickness_mm, JAW.finger_width_mm, JAW.finger_length_mm]) / 1e3
    for corners in closing(k):
        assert np.ptp(corners, axis=0) == pytest.approx(sizes)
        assert corners[:, 2].min() == pytest.approx(JAW.clearance_mm / 1e3)


def test_too_short_a_finger_is_one_line() -> None:
    with pytest.raises(ParameterError, match=r"gripper\.finger_length_mm"):
        Kinematics.from_params(replace(GRIPPER, finger_length_mm=10))


def block_world(gripper: Gripper, height: float = LOW, step_ms: float = 1.0) -> GraspWorld:
    block = trimesh.creation.box([0.05, 0.05, height])
    resting = Resting(block, block, translation(0, 0, height / 2))
    world = GraspWorld(resting, replace(PHYSICS, time_step_ms=step_ms), gripper)
    world.place_object(resting.T_world_object)
    world.place_hand(np.zeros(3))
    return world


@GRIPPERS
def test_the_bodies_are_where_the_kinematics_says(gripper: Gripper) -> None:
    world, q = block_world(gripper), np.array([0.03, -0.02, 0.5])
    world.place_hand(q)
    k = world.kinematics
    for share in ((0.0, 0.0), (0.2, 0.7), (1.0, 1.0)):
        left, right = k.open + np.array(share) * (k.closed - k.open)
        world.hand.setPositions([0.05, left, right])
        bodies = [body.getShapeNode(0) for body in world.hand.getBodyNodes()]
        for shape, (T, size) in zip(bodies, k.parts((left, right)), strict=True):
            expected = T_world_grasp(q) @ translation(0, 0, 0.05) @ T
            assert shape.getWorldTransform().matrix() == pytest.approx(expected, abs=1e-12)
            assert shape.getShape().getSize() == pytest.approx(size)


@pytest.mark.parametrize(
    ("gripper", "speed"),
    [(GRIPPER, GRIPPER.closing_speed_rads), (JAW, JAW.closing_speed_mms / 1e3)],
    ids=["revolute", "prismatic"],
)
def test_free_fingers_close_at_the_closing_speed(gripper: Gripper, speed: float) -> None:
    world = block_world(gripper)
    world.place_hand(np.array([1.0, 0, 0]))
    while world.hand.getPositions()[1] < (world.kinematics.open + world.kinematics.closed) / 2:
        world.drive(0.0)
    assert world.hand.getVelocities()[1:] == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize("step_ms", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("gripper", [LOOSE, LOOSE_JAW], ids=["revolute", "prismatic"])
def test_grip_force_balances_the_effort_whatever_the_step(gripper: Gripper, step_ms: float) -> None:
    world = block_world(gripper, step_ms=step_ms)
    for _ in range(round(1200 / step_ms)):
        world.drive(0.0)
    arm = (lambda z: world.kinematics.height - z) if world.kinematics.turns else (lambda z: 1.0)
    effort = sum(
        abs(contact.force[0]) * arm(contact.point[2])
        for contact in world.world.getLastCollisionResult().getContacts()
        if contact.point[0] > 0.02 and abs(contact.normal[0]) > 0.9
    )
    assert effort == pytest.approx(world.kinematics.effort, rel=0.05)


def test_the_hand_rises_20_cm_at_a_tenth_of_a_metre_per_second() -> None:
    block = trimesh.creation.box([0.05, 0.05, HIGH])
    grasper = Grasper(Resting(block, block, translation(0, 0, HIGH / 2)), Rig(PHYSICS, GRIPPER, ATTEMPT))
    result = grasper.run(np.zeros(3), whole=True, film=True)
    assert result.held
    z = np.array([frame.hand_z for frame in result.frames])
    t = np.array([frame.time_s for frame in result.frames])
    rising = z > 0
    assert z[-1] == pytest.approx(ATTEMPT.lift_mm / 1e3, abs=1e-6)
    assert np.diff(z[rising]) / np.diff(t[rising]) == pytest.approx(ATTEMPT.lift_speed_mms / 1e3, rel=1e-6)
    assert t[~rising].max() == pytest.approx(ATTEMPT.close_s, abs=1e-9)
    assert result.frames[-1].T_world_object[2, 3] - HIGH / 2 == pytest.approx(0.2, abs=0.003)


def test_a_parallel_jaw_labels_an_object() -> None:
    """A bar between the pads is held wherever they meet it squarely, and never where they cannot reach it."""
    bar = trimesh.creation.box([0.03, 0.05, 0.03])
    resting = Resting(bar, bar, translation(0, 0, 0.015))
    rig = Rig(PHYSICS, JAW, JAW_ATTEMPT)
    labels = label_object(resting, 1, rig, np.random.default_rng(0), angles=slice(0, 1))
    assert sum(labels.account[outcome] for outcome in OUTCOMES) == labels.successes.size
    q = grid.poses()[:, :, :1]
    u, v = np.abs(q[..., 0]), np.abs(q[..., 1])
    assert labels.successes[(u < 0.015) & (v < 0.015)].all()
    assert not labels.successes[(u > 0.065) | (v > 0.045)].any()
