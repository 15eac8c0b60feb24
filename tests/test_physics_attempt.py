"""Attempts: repeatable, early stops without a say in the outcome; settling and the bodies."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from physics_params import ATTEMPT, GRIPPER, PARAMS, PHYSICS, SETTLE, touching_poses

from graspfn.geometry import grid
from graspfn.geometry.transforms import apply, translation
from graspfn.meshes.placed import RESTING, Resting
from graspfn.physics.attempt import Grasper, Outcome
from graspfn.physics.bodies import sole
from graspfn.physics.culling import touches_nothing
from graspfn.physics.settling import settle
from graspfn.physics.world import GraspWorld, Rig, TableWorld
from graspfn.selection import procedural
from graspfn.selection.collision import collision_mesh

BAR = trimesh.creation.box([0.03, 0.14, 0.04])
RING = trimesh.creation.annulus(0.045, 0.06, 0.03)
BAR_LYING = Resting(BAR, BAR, translation(0, 0, 0.02))
RING_LYING = Resting(RING, RING, translation(0, 0, 0.015))


def grasper(resting: Resting) -> Grasper:
    return Grasper(resting, Rig(PHYSICS, GRIPPER, ATTEMPT))


def test_good_and_bad_grasps_of_a_bar() -> None:
    attempts = grasper(BAR_LYING)
    assert attempts.run(np.array([0, 0, 0])).outcome is Outcome.HELD
    assert attempts.run(np.array([0, 0, np.pi / 2])).outcome is Outcome.COLLIDED  # jaws along its length
    assert attempts.run(np.array([0, 0.2, 0])).outcome is Outcome.UNTOUCHED
    assert not attempts.run(np.array([0, 0.2, 0]), whole=True).held


def test_order_and_repetition_change_no_bit() -> None:
    poses = touching_poses(RING_LYING, 8)

    def finals(order: np.ndarray) -> dict[int, bytes]:
        attempts, found = grasper(RING_LYING), {}
        for i in order:
            result = attempts.run(poses[i])
            found[int(i)] = result.outcome.encode() + attempts.world.object_pose().tobytes()
        return found

    there = finals(np.arange(len(poses)))
    assert there == finals(np.arange(len(poses))[::-1]) == finals(np.arange(len(poses)))


@pytest.mark.parametrize("resting", [BAR_LYING, RING_LYING], ids=["bar", "ring"])
def test_early_stops_keep_the_outcome_of_the_whole_run(resting: Resting) -> None:
    attempts = grasper(resting)
    poses = touching_poses(resting, 12)
    stopped = [attempts.run(q) for q in poses]
    whole = [attempts.run(q, whole=True) for q in poses]
    assert np.mean([one.held == other.held for one, other in zip(stopped, whole, strict=True)]) >= 11 / 12
    assert any(result.held for result in whole) and any(result.early for result in stopped)
    assert not any(result.early for result in whole)


def test_a_half_turn_of_the_hand_changes_nothing() -> None:
    attempts = grasper(BAR_LYING)
    poses = touching_poses(BAR_LYING, 8)
    same = [attempts.run(q).outcome is attempts.run(q + np.array([0, 0, np.pi])).outcome for q in poses]
    assert np.mean(same) >= 7 / 8


def test_culled_attempts_leave_the_object_alone() -> None:
    attempts = grasper(RING_LYING)
    q = grid.sample_cells(1, np.random.default_rng(1)).reshape(-1, 3)
    culled = q[touches_nothing(RING_LYING, q, attempts.world.kinematics)]
    near = culled[np.argsort(np.hypot(culled[:, 0], culled[:, 1]))[:15]]  # the ones that are nearly not culled
    for pose in near:
        assert attempts.run(pose, whole=True).outcome is Outcome.LEFT
        assert attempts.world.object_pose() == pytest.approx(RING_LYING.T_world_object, abs=2e-3)


def test_a_finger_wholly_inside_a_solid_collides() -> None:
    cube = trimesh.creation.box([0.2, 0.2, 0.2])
    assert grasper(Resting(cube, cube, translation(0, 0, 0.1))).run(np.zeros(3)).outcome is Outcome.COLLIDED


@pytest.mark.parametrize("category", ["bottle", "cup"])
def test_no_accepted_attempt_has_bodies_2_mm_deep_in_each_other(category: str, monkeypatch: pytest.MonkeyPatch) -> None:
    depths: list[float] = []
    drive = GraspWorld.drive

    def watched(world: GraspWorld, rise: float, steps: int = 1) -> None:
        for _ in range(steps):
            drive(world, rise)
            depths.extend(contact.penetrationDepth for contact in world.world.getLastCollisionResult().getContacts())

    monkeypatch.setattr(GraspWorld, "drive", watched)
    mesh = procedural.generate(category, np.random.default_rng(0))
    mesh.apply_scale(0.08 / mesh.extents.max())
    mesh.apply_translation(-mesh.center_mass)
    collision = collision_mesh(mesh, PARAMS.meshes.collision_faces, PARAMS.meshes.collision_tolerance_mm / 1e3)
    T = settle(mesh, PHYSICS, SETTLE, np.random.default_rng(0)).T_world_object
    attempts = grasper(Resting(mesh, collision, T))
    deepest = []
    for q in touching_poses(attempts.resting, 25):
        depths.clear()
        if attempts.run(q, whole=True).held:
            deepest.append(max(depths))
    assert len(deepest) >= 3
    assert max(deepest) < 2e-3


@pytest.mark.parametrize("seed", range(6))
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
