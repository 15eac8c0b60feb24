"""Attempts: repeatable, moving with the object, early stops without a say in the outcome."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from physics_params import ATTEMPT, GRIPPER, PARAMS, PHYSICS, SETTLE

from graspfn.evaluation.trials import Bench
from graspfn.geometry import grid
from graspfn.geometry.transforms import apply, move_pose, rotation_z, translation
from graspfn.meshes.placed import RESTING
from graspfn.physics.attempt import Grasper, Outcome
from graspfn.physics.bodies import sole
from graspfn.physics.culling import touches_nothing
from graspfn.physics.gripper import Kinematics
from graspfn.physics.labelling import label_object
from graspfn.physics.settling import settle
from graspfn.physics.world import GraspWorld, TableWorld
from graspfn.selection import procedural

BAR = trimesh.creation.box([0.03, 0.14, 0.04])
T_BAR = translation(0, 0, 0.02)
RING = trimesh.creation.annulus(0.045, 0.06, 0.03)
T_RING = translation(0, 0, 0.015)


def grasper(mesh: trimesh.Trimesh, T: np.ndarray) -> Grasper:
    return Grasper(GraspWorld(mesh, mesh, PHYSICS, GRIPPER), T, ATTEMPT)


def some_poses(mesh: trimesh.Trimesh, T: np.ndarray, count: int) -> np.ndarray:
    """Poses whose fingers start clear of the object and may meet it."""
    rng = np.random.default_rng(3)
    q = grid.sample_cells(1, rng).reshape(-1, 3)
    q = q[~touches_nothing(apply(T, mesh.vertices)[:, :2], q, Kinematics.from_params(GRIPPER))]
    world = GraspWorld(mesh, mesh, PHYSICS, GRIPPER)
    world.place_object(T)
    clear = []
    for pose in rng.permutation(q):
        world.place_hand(pose)
        if not world.hand_touches_object() and not world.hand_inside_object():
            clear.append(pose)
        if len(clear) == count:
            break
    return np.array(clear)


def test_good_and_bad_grasps_of_a_bar() -> None:
    attempts = grasper(BAR, T_BAR)
    assert attempts.run(np.array([0, 0, 0])) is Outcome.HELD
    assert attempts.run(np.array([0, 0, np.pi / 2])) is Outcome.COLLIDED  # jaws along its length
    assert attempts.run(np.array([0, 0.2, 0])) is Outcome.UNTOUCHED
    assert attempts.run(np.array([0, 0.2, 0]), whole=True) is not Outcome.HELD


def test_order_and_repetition_change_no_bit() -> None:
    poses = some_poses(RING, T_RING, 8)

    def finals(order: np.ndarray) -> dict[int, bytes]:
        attempts, found = grasper(RING, T_RING), {}
        for i in order:
            outcome = attempts.run(poses[i])
            found[int(i)] = outcome.encode() + attempts.world.object_pose().tobytes()
        return found

    there = finals(np.arange(len(poses)))
    assert there == finals(np.arange(len(poses))[::-1]) == finals(np.arange(len(poses)))


@pytest.mark.parametrize(("mesh", "T"), [(BAR, T_BAR), (RING, T_RING)], ids=["bar", "ring"])
def test_early_stops_keep_the_outcome_of_the_whole_run(mesh: trimesh.Trimesh, T: np.ndarray) -> None:
    attempts = grasper(mesh, T)
    poses = some_poses(mesh, T, 12)
    early = [attempts.run(q) is Outcome.HELD for q in poses]
    whole = [attempts.run(q, whole=True) is Outcome.HELD for q in poses]
    assert np.mean(np.array(early) == whole) >= 11 / 12
    assert any(whole)


def test_a_half_turn_of_the_hand_changes_nothing() -> None:
    attempts = grasper(BAR, T_BAR)
    poses = some_poses(BAR, T_BAR, 8)
    same = [attempts.run(q) == attempts.run(q + np.array([0, 0, np.pi])) for q in poses]
    assert np.mean(same) >= 7 / 8


def test_moving_the_object_moves_its_grasps() -> None:
    """The world does not know where on the table it is: a moved object under a moved hand, against moved poses."""
    shift, theta = np.array([0.05, -0.03]), 0.7
    moved_T = translation(shift[0], -shift[1]) @ rotation_z(-theta) @ T_RING
    moved, bench = grasper(RING, moved_T), Bench(RING, RING, T_RING, PHYSICS, GRIPPER, ATTEMPT)
    poses = move_pose(some_poses(RING, T_RING, 10), shift, theta)
    same = [moved.run(q) is bench.grasp(q, shift, theta) for q in poses]
    assert np.mean(same) >= 0.9


def test_culled_attempts_leave_the_object_alone() -> None:
    attempts = grasper(RING, T_RING)
    q = grid.sample_cells(1, np.random.default_rng(1)).reshape(-1, 3)
    culled = q[touches_nothing(apply(T_RING, RING.vertices)[:, :2], q, attempts.world.kinematics)]
    near = culled[np.argsort(np.hypot(culled[:, 0], culled[:, 1]))[:15]]  # the ones that are nearly not culled
    for pose in near:
        assert attempts.run(pose, whole=True) in (Outcome.MISSED, Outcome.LEFT)
        assert attempts.world.object_pose() == pytest.approx(T_RING, abs=2e-3)


def test_a_finger_wholly_inside_a_solid_collides() -> None:
    cube = trimesh.creation.box([0.2, 0.2, 0.2])
    assert grasper(cube, translation(0, 0, 0.1)).run(np.zeros(3)) is Outcome.COLLIDED


def test_a_state_that_ran_away_is_marked_and_never_stepped() -> None:
    attempts = grasper(BAR, T_BAR)
    place = attempts.world.place_object

    def thrown(T: np.ndarray) -> None:
        place(T)
        attempts.world.object.setVelocities([0, 0, 0, np.nan, 0, 0])

    attempts.world.place_object = thrown  # type: ignore[method-assign]
    assert attempts.run(np.zeros(3)) is Outcome.DIVERGED


def test_free_fall() -> None:
    world = TableWorld(BAR, PHYSICS)
    world.place_object(translation(0, 0, 1.0))
    for _ in range(200):
        world.step()
    t, dt = 0.2, world.time_step
    assert world.object_pose()[2, 3] == pytest.approx(1.0 - 9.81 * t * (t + dt) / 2, abs=1e-6)  # semi-implicit Euler


@pytest.mark.parametrize("seed", range(4))
def test_a_settled_box_rests_on_a_face(seed: int) -> None:
    box = trimesh.creation.box([0.04, 0.06, 0.09])
    settled = settle(box, PHYSICS, SETTLE, np.random.default_rng(seed))
    assert settled.status == RESTING
    corners = apply(settled.T_world_object, box.vertices)
    assert corners[:, 2].min() == pytest.approx(0, abs=1e-3)
    half_heights = np.array([0.02, 0.03, 0.045])
    assert np.abs(half_heights - settled.T_world_object[2, 3]).min() < 5e-4
    middle = (corners[:, :2].min(axis=0) + corners[:, :2].max(axis=0)) / 2
    assert middle == pytest.approx([0, 0], abs=1e-9)


def test_settling_depends_on_the_generator_alone() -> None:
    first, second = (settle(RING, PHYSICS, SETTLE, np.random.default_rng(5)) for _ in range(2))
    assert first.T_world_object.tobytes() == second.T_world_object.tobytes()


def test_labels_account_for_every_attempt() -> None:
    small = trimesh.creation.icosphere(1, 0.012)
    T = translation(0, 0, 0.012)
    brief = replace(ATTEMPT, lift_mm=20)
    labels = label_object(small, small, T, 1, PHYSICS, GRIPPER, brief, np.random.default_rng(0))
    assert labels.successes.shape == grid.SHAPE
    assert sum(labels.account.values()) == 8712
    assert labels.account["held"] == labels.successes.sum()
    assert PARAMS.label.attempts * 8712 == 43560


@pytest.mark.parametrize("category", sorted(procedural.CATEGORIES))
def test_a_body_has_the_mass_of_its_mesh_whatever_touches(category: str) -> None:
    mesh = procedural.generate(category, np.random.default_rng(2))
    mesh.apply_scale(0.1 / mesh.extents.max())
    mesh.apply_translation(-mesh.center_mass)
    world = TableWorld(mesh, PHYSICS, collision=mesh.convex_hull)
    assert world.object.getMass() == pytest.approx(mesh.volume * PHYSICS.density_kgm3, rel=1e-3)
    assert world.object.getCOM() == pytest.approx([0, 0, 0], abs=1e-6)


def test_the_sole_reaches_as_far_as_the_mesh() -> None:
    ball = trimesh.creation.icosphere(4, 0.05)  # 2562 vertices, thinned out
    for mesh in (ball, RING):
        for direction in np.random.default_rng(0).normal(size=(50, 3)):
            unit = direction / np.linalg.norm(direction)
            assert (sole(mesh) @ unit).max() == pytest.approx((mesh.vertices @ unit).max(), abs=1e-3)
