"""Grasping against closed forms: Coulomb's friction, free fall, the symmetries of objects and of the table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from physics_params import ATTEMPT, GRIPPER, JAW, JAW_ATTEMPT, PHYSICS, touching_poses

from graspfn.evaluation.bench import Bench, Scene
from graspfn.geometry.transforms import move_pose, rotation_z, translation
from graspfn.meshes.placed import Resting
from graspfn.params import Gripper
from graspfn.physics.attempt import Grasper
from graspfn.physics.contacts import SLOP_M
from graspfn.physics.gripper import Kinematics, Revolute
from graspfn.physics.world import Rig, TableWorld

RIG = Rig(PHYSICS, GRIPPER, ATTEMPT)
# Drives without friction of their own, whose grip is decided.
LOOSE, LOOSE_JAW = replace(GRIPPER, gear_friction_nm=0.0), replace(JAW, drive_friction_n=0.0)
EDGE = 0.05  # of the blocks, metres
# So slowly, since the hand sets off at once: until a block of weight W that is held with F has caught up with it, it
# slips by v^2 / 2g (F/W - 1), at 1% 5 cm for 0.1 m/s, and 0.5 mm for this.
SLOW = {"lift_mm": 20.0, "lift_speed_mms": 10.0}


def upright(mesh: trimesh.Trimesh, theta: float = 0.0) -> Resting:
    """The mesh, its origin in the centre of mass, standing on its lowest face, turned by theta in the image."""
    return Resting(mesh, mesh, rotation_z(-theta) @ translation(0, 0, -mesh.bounds[0, 2]))


def lifted(gripper: Gripper, height: float, weight: float, theta: float) -> bool:
    """Whether a hand turned by theta lifts a block that is turned with it; metres, newtons."""
    block = trimesh.creation.box([EDGE, EDGE, height])
    physics = replace(PHYSICS, density_kgm3=weight / 9.81 / block.volume)
    attempt = replace(JAW_ATTEMPT if gripper is LOOSE_JAW else ATTEMPT, **SLOW)
    grasper = Grasper(upright(block, theta), Rig(physics, gripper, attempt))
    return grasper.run(np.array([0, 0, theta]), whole=True).held


def revolute_limit(height: float) -> float:
    """The weight at which a block slips between fingers under constant torque, newtons."""
    k = Kinematics.from_params(LOOSE)
    assert isinstance(k, Revolute)
    x, z, depth = k.joint_x - EDGE / 2, k.height - height, k.thickness / 2  # pads touch the block's upper edges
    arm = np.sqrt(x**2 + z**2 - depth**2)
    slope = np.arcsin(depth / np.hypot(x, z)) - np.arctan2(x, z)
    # The pads lie `depth` inside the joints, so that friction has an arm as well; and they press the block down.
    force = LOOSE.torque_nm / (arm + PHYSICS.friction * depth)
    return float(2 * force * (PHYSICS.friction * np.cos(slope) - np.sin(slope)))


TURNED = pytest.mark.parametrize("theta", [0.0, np.pi / 4], ids=["straight", "turned"])


@TURNED
def test_upright_pads_hold_exactly_2_mu_f(theta: float) -> None:
    limit = 2 * PHYSICS.friction * LOOSE_JAW.force_n
    shares = np.array([0.5, 0.9, 0.98, 1.02, 1.1, 1.5])
    assert [lifted(LOOSE_JAW, 0.04, share * limit, theta) for share in shares] == (shares < 1).tolist()


@TURNED
@pytest.mark.parametrize("height", [0.03, 0.06])
def test_sloping_pads_hold_what_friction_allows(height: float, theta: float) -> None:
    """DART's solver bounds friction by what the normal force would be without it: up to 11% too much for a torque."""
    shares = np.array([0.5, 0.8, 0.93, 1.12, 1.5])  # nearer to 1, what hangs by its edges may tip
    limit = revolute_limit(height)
    assert [lifted(LOOSE, height, share * limit, theta) for share in shares] == (shares < 1).tolist()


@pytest.mark.parametrize("mass", [0.003, 0.03, 0.3])
@pytest.mark.parametrize(("friction", "taper", "holds"), [(1.0, 40, True), (0.5, 22, True), (0.5, 40, False)])
def test_a_taper_holds_within_the_friction_cone(friction: float, taper: float, holds: bool, mass: float) -> None:
    """Fingers that close on a wedge hold it up to a taper of arctan μ, whatever its mass; beyond, it slides out."""
    reach = 0.015 * np.tan(np.radians(taper))
    plan = [(side * (0.0225 + end * reach), end * 0.015) for side in (-1, 1) for end in (-1, 1)]
    wedge = trimesh.Trimesh([(x, y, z) for x, y in plan for z in (0.0, 0.025)]).convex_hull
    wedge.apply_translation(-wedge.center_mass)
    resting = upright(wedge)
    physics = replace(PHYSICS, friction=friction, density_kgm3=mass / wedge.volume)
    rig = replace(RIG, physics=physics, attempt=replace(ATTEMPT, lift_mm=1))
    end = Grasper(resting, rig).run(np.zeros(3), whole=True, film=True).frames[-1]
    moved = np.hypot(*(end.T_world_object - resting.T_world_object)[:2, 3])
    assert bool(moved < 0.005) is holds


@pytest.mark.parametrize("diameter", [0.02, 0.03, 0.04])
@pytest.mark.parametrize("offset", [0.02, 0.04, 0.06])
@pytest.mark.parametrize(("step_ms", "course"), [(2.0, {}), (2.0, SLOW), (1.0, SLOW), (0.5, SLOW)])
def test_pads_keep_a_rod_from_turning(diameter: float, offset: float, step_ms: float, course: dict[str, float]) -> None:
    """Held beside its middle, it hangs by two lines of contact, whose friction has half the pads' width for an arm.

    A hand that sets off at 0.1 m/s within less than 2 ms tears the longer arms out of the pads.
    """
    rod = trimesh.creation.cylinder(diameter / 2, 0.2)
    rod.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    weight = PHYSICS.density_kgm3 * rod.volume * 9.81
    force = (GRIPPER.torque_nm - GRIPPER.gear_friction_nm) / (GRIPPER.finger_length_mm / 1e3)  # at the least
    assert weight * offset < 0.3 * 2 * PHYSICS.friction * force * GRIPPER.finger_width_mm / 2e3
    rig = replace(RIG, physics=replace(PHYSICS, time_step_ms=step_ms), attempt=replace(ATTEMPT, **course))
    frames = Grasper(upright(rod), rig).run(np.array([0, offset, 0]), whole=True, film=True).frames
    axes = np.array([frame.T_world_object[:3, 1] for frame in frames])
    assert frames[-1].T_world_object[2, 3] == pytest.approx(diameter / 2 + frames[-1].hand_z, abs=1e-3)
    assert np.degrees(np.arccos(axes @ axes[0])).max() < 0.5


@pytest.mark.parametrize("depth", [5e-5, 2e-4], ids=["shallow", "deep"])
def test_contacts_are_pushed_out_as_far_as_the_slop(depth: float) -> None:
    """DART takes 1% off what is deeper in each step. Pushed out to the surface, contacts come and go."""
    world = TableWorld(trimesh.creation.box([EDGE, EDGE, EDGE]), PHYSICS)
    world.place_object(translation(0, 0, EDGE / 2 - depth))
    for _ in range(200):
        world.step()
    left = min(depth, SLOP_M) + max(depth - SLOP_M, 0) * 0.99**200
    assert -world.lowest_point() == pytest.approx(left, rel=0.01)


def test_free_fall() -> None:
    world = TableWorld(trimesh.creation.box([0.03, 0.14, 0.04]), PHYSICS)
    world.place_object(translation(0, 0, 1.0))
    t, dt = 0.2, world.time_step
    for _ in range(round(t / dt)):
        world.step()
    assert world.object_pose()[2, 3] == pytest.approx(1.0 - 9.81 * t * (t + dt) / 2, abs=1e-6)  # semi-implicit Euler


def held(grasper: Grasper, poses: np.ndarray) -> np.ndarray:
    """Which of the poses (m, 3) hold; (m,) bool."""
    return np.array([grasper.run(q).held for q in poses])


def agreement(one: np.ndarray, other: np.ndarray) -> float:
    """Share of the poses that hold in both or in neither; some must hold and some not, or it would mean little."""
    assert 0.1 < one.mean() < 0.9
    return float(np.mean(one == other))


def test_an_upright_cylinder_is_the_same_from_all_sides() -> None:
    grasper = Grasper(upright(trimesh.creation.cylinder(0.03, 0.05, sections=64)), RIG)
    poses = touching_poses(grasper.resting, 80)
    seen = held(grasper, poses)
    for theta in (0.4, np.pi / 2):  # of 160 poses 0.94, at any angle: one facet more or less decides the poorest grasps
        assert agreement(seen, held(grasper, move_pose(poses, np.zeros(2), theta))) >= 0.9


@pytest.mark.parametrize(
    "image",
    [lambda u, v, theta: (-u, v, -theta), lambda u, v, theta: (u, -v, -theta), lambda u, v, theta: (-u, -v, theta)],
    ids=["mirrored in u", "mirrored in v", "half a turn"],
)
def test_a_boxs_grasps_have_its_symmetries(image: Callable[..., tuple[np.ndarray, ...]]) -> None:
    grasper = Grasper(upright(trimesh.creation.box([0.05, 0.09, 0.04])), RIG)
    poses = touching_poses(grasper.resting, 40)
    assert agreement(held(grasper, poses), held(grasper, np.stack(image(*poses.T), axis=-1))) >= 0.95


# The table's friction is a pyramid along the axes of the world, so that what slides tells 40 degrees from 90.
@pytest.mark.parametrize(("shift", "theta", "least"), [((0.05, -0.03), np.pi / 2, 0.95), ((-0.1, 0.08), 0.7, 0.9)])
def test_moving_and_turning_an_object_moves_its_grasps(shift: tuple[float, float], theta: float, least: float) -> None:
    """A moved object under a moved hand, against a bench that moves poses back instead."""
    wedge = trimesh.creation.box([0.06, 0.1, 0.05])
    wedge = trimesh.convex.convex_hull(wedge.vertices * [[0.4 if y > 0 else 1, 1, 1] for y in wedge.vertices[:, 1]])
    wedge.apply_translation(-wedge.center_mass)
    resting = upright(wedge)
    moved = replace(resting, T_world_object=translation(shift[0], -shift[1]) @ upright(wedge, theta).T_world_object)
    scene = Scene("wedge", np.empty((0, 0)), np.array(shift), theta)
    poses, bench = scene.moved(touching_poses(resting, 40)), Bench(resting, RIG, scene)
    there = np.array([bench.grasp(q).held for q in poses])
    assert agreement(held(Grasper(moved, RIG), poses), there) >= least
