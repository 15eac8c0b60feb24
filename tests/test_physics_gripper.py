"""The gripper's kinematics and the force it grips with, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from physics_params import ATTEMPT, GRIPPER, PHYSICS

from graspfn.geometry.transforms import translation
from graspfn.params import ParameterError
from graspfn.physics.attempt import Frame, Grasper, Outcome
from graspfn.physics.gripper import Kinematics
from graspfn.physics.world import GraspWorld

K = Kinematics.from_params(GRIPPER)


def finger_corners(angles: tuple[float, float]) -> list[np.ndarray]:
    """Corners (8, 3) of left and right finger in the hand's frame."""
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).T.reshape(-1, 3) / 2
    return [signs * size @ T[:3, :3].T + T[:3, 3] for T, size in K.parts(angles)[1:]]


def test_open_fingertips_are_the_opening_apart() -> None:
    left, right = finger_corners((K.open_angle, K.open_angle))
    inner_tips = [corners[np.argsort(corners[:, 2])[:4]] for corners in (left, right)]
    gap = inner_tips[1][:, 0].min() - inner_tips[0][:, 0].max()
    assert gap == pytest.approx(GRIPPER.opening_mm / 1e3, abs=1e-9)


def test_closed_fingertips_meet() -> None:
    left, right = finger_corners((K.closed_angle, K.closed_angle))
    assert left[:, 0].max() == pytest.approx(0, abs=1e-9)
    assert right[:, 0].min() == pytest.approx(0, abs=1e-9)


def test_lowest_point_of_the_closing_is_the_clearance() -> None:
    heights = [finger_corners((a, a))[0][:, 2].min() for a in np.linspace(K.open_angle, K.closed_angle, 500)]
    assert min(heights) == pytest.approx(GRIPPER.clearance_mm / 1e3, abs=1e-6)


def test_fingers_mirror_each_other() -> None:
    left, right = finger_corners((0.1, 0.1))
    mirrored = left * [-1, 1, 1]
    assert {tuple(p) for p in np.round(mirrored, 9)} == {tuple(p) for p in np.round(right, 9)}


def test_too_short_a_finger_is_one_line() -> None:
    with pytest.raises(ParameterError, match=r"gripper\.finger_length_mm"):
        Kinematics.from_params(replace(GRIPPER, finger_length_mm=10))


def block_world(density: float = 300.0, gear_friction: float = 0.0, step_ms: float = 1.0) -> GraspWorld:
    block = trimesh.creation.box([0.05, 0.05, 0.06])
    world = GraspWorld(
        block,
        block,
        replace(PHYSICS, density_kgm3=density, time_step_ms=step_ms),
        replace(GRIPPER, gear_friction_nm=gear_friction),
    )
    world.place_object(translation(0, 0, 0.03))
    world.place_hand(np.zeros(3))
    return world


@pytest.mark.parametrize("step_ms", [0.5, 1.0])
def test_grip_force_balances_the_torque_whatever_the_step(step_ms: float) -> None:
    world = block_world(step_ms=step_ms)
    for _ in range(round(600 / step_ms)):
        world.drive(0.0)
    torque = sum(
        abs(contact.force[0]) * (K.knuckle_z - contact.point[2])
        for contact in world.world.getLastCollisionResult().getContacts()
        if contact.point[0] > 0.02 and abs(contact.normal[0]) > 0.9
    )
    assert torque == pytest.approx(GRIPPER.torque_nm, rel=0.05)


@pytest.mark.parametrize(("share", "held"), [(0.8, True), (1.3, False)])
def test_a_block_slips_when_it_needs_more_friction_than_mu_n(share: float, held: bool) -> None:
    """Two pads hold m g up to 2 mu N, N the torque over the height of the joints above the contact."""
    angle = -0.0487  # the fingers' slope on the 5 cm block; pads touch its upper edges
    force = GRIPPER.torque_nm / (K.knuckle_z - 0.06)
    # Sloping pads press the block down with N sin(a): vertical balance gives 2 N (mu cos a - sin |a|).
    limit = 2 * force * (PHYSICS.friction * np.cos(angle) - np.sin(abs(angle)))
    density = share * limit / 9.81 / (0.05 * 0.05 * 0.06)
    grasper = Grasper(block_world(density), translation(0, 0, 0.03), ATTEMPT)
    assert (grasper.run(np.zeros(3), whole=True) is Outcome.HELD) == held


def test_the_hand_rises_20_cm_at_a_tenth_of_a_metre_per_second() -> None:
    frames: list[Frame] = []
    grasper = Grasper(block_world(), translation(0, 0, 0.03), ATTEMPT)
    assert grasper.run(np.zeros(3), frames.append, whole=True) is Outcome.HELD
    z = np.array([frame.hand_z for frame in frames])
    t = np.array([frame.time_s for frame in frames])
    rising = z > 0
    assert z[-1] == pytest.approx(ATTEMPT.lift_mm / 1e3, abs=1e-6)
    assert np.diff(z[rising]) / np.diff(t[rising]) == pytest.approx(ATTEMPT.lift_speed_mms / 1e3, rel=1e-6)
    assert t[~rising].max() == pytest.approx(ATTEMPT.close_s, abs=1e-9)
    assert frames[-1].T_world_object[2, 3] - 0.03 == pytest.approx(0.2, abs=0.003)
