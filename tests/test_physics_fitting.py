"""Objects are placed at rest and between the open fingers, by closed forms and by DART's own collisions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from physics_params import GRIPPER, JAW, PHYSICS, SETTLE

from graspfn.geometry.transforms import apply, rotation_z, translation
from graspfn.meshes.placed import RESTING, Resting
from graspfn.params import Gripper
from graspfn.physics.fitting import CELL_M, fitting_pose, place, surface
from graspfn.physics.gripper import Kinematics
from graspfn.physics.world import GraspWorld, TableWorld

GRIPPERS = pytest.mark.parametrize("gripper", [GRIPPER, JAW], ids=["revolute", "prismatic"])
BLUR_M = 2 * CELL_M  # by how much the map of heights may be off


def standing(*extents: float) -> trimesh.Trimesh:
    """A box on the table, at no angle of its own."""
    return trimesh.creation.box(extents, translation(0.0031, 0.0017, extents[2] / 2))


def turned(mesh: trimesh.Trimesh, degrees: float, x: float = 0, y: float = 0) -> trimesh.Trimesh:
    return mesh.copy().apply_transform(translation(x, y) @ rotation_z(np.radians(degrees)))


def pose_for(mesh: trimesh.Trimesh, gripper: Gripper, room_m: float) -> np.ndarray | None:
    return fitting_pose(surface(mesh), Kinematics.from_params(gripper), room_m, friction=1.0)


def hand_is_clear(mesh: trimesh.Trimesh, gripper: Gripper, q: np.ndarray) -> bool:
    world = GraspWorld(Resting(mesh, mesh, np.eye(4)), PHYSICS, gripper)
    world.place_object(np.eye(4))
    world.place_hand(q)
    return not world.hand_touches_object()


@GRIPPERS
@pytest.mark.parametrize(("length", "height"), [(0.06, 0.01), (0.15, 0.04), (0.2, 0.045)])
def test_boxes_fit_up_to_the_gap_less_the_room(gripper: Gripper, length: float, height: float) -> None:
    gap, lean = Kinematics.from_params(gripper).gap()
    widest = gap - 0.02 - 2 * lean * height
    assert pose_for(standing(widest - BLUR_M, length, height), gripper, 0.02) is not None
    assert pose_for(standing(widest + BLUR_M, max(length, widest + 0.01), height), gripper, 0.02) is None


@GRIPPERS
def test_nothing_fits_that_meets_the_palm_or_passes_below_the_tips(gripper: Gripper) -> None:
    k = Kinematics.from_params(gripper)
    assert pose_for(standing(0.02, 0.02, k.height - 1e-4), gripper, 0.02) is not None
    assert pose_for(standing(0.02, 0.02, k.height + 1e-4), gripper, 0.02) is None
    assert pose_for(standing(0.02, 0.02, k.clearance + 1e-4), gripper, 0.02) is not None
    assert pose_for(standing(0.02, 0.02, k.clearance - 1e-4), gripper, 0.02) is None


@GRIPPERS
def test_a_part_is_enough_and_the_open_hand_is_clear_there(gripper: Gripper) -> None:
    hammer = trimesh.boolean.union(
        [standing(0.13, 0.12, 0.04), standing(0.03, 0.2, 0.03).apply_translation([0, 0.1, 0])]
    )
    dumbbell = trimesh.boolean.union(
        [standing(0.12, 0.06, 0.045).apply_translation([0, y, 0]) for y in (-0.06, 0.06)] + [standing(0.03, 0.1, 0.04)]
    )
    frame = trimesh.boolean.difference([standing(0.19, 0.19, 0.02), standing(0.13, 0.13, 0.05)])
    for mesh in (hammer, dumbbell, frame):
        for degrees in (0, 35, 80, 145):
            moved = turned(mesh, degrees, 0.02, -0.03)
            q = pose_for(moved, gripper, 0.02)
            assert q is not None and hand_is_clear(moved, gripper, q)
            around = [[q[0] + x, -q[1] + y, 1.0] for x in (-CELL_M, 0, CELL_M) for y in (-CELL_M, 0, CELL_M)]
            assert moved.ray.intersects_any(around, [[0, 0, -1.0]] * 9).any()


@GRIPPERS
def test_corners_and_what_is_wide_everywhere_do_not_fit(gripper: Gripper) -> None:
    slab, ball = standing(0.14, 0.18, 0.03), trimesh.creation.icosphere(radius=0.055).apply_translation([0, 0, 0.055])
    shell = trimesh.boolean.difference([slab, standing(0.12, 0.16, 0.06).apply_translation([0, 0, 0.01])])
    for mesh in (slab, ball, shell):
        for degrees in (0, 25, 45):
            assert pose_for(turned(mesh, degrees), gripper, 0.0) is None


def test_more_room_is_asked_of_fewer() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        mesh = trimesh.convex.convex_hull(rng.uniform(-0.06, 0.06, (12, 3)) * [1, 1, 0.5] + [0, 0, 0.03])
        fits = [pose_for(mesh, GRIPPER, room) is not None for room in (0.0, 0.01, 0.02, 0.03, 0.04)]
        assert fits == sorted(fits, reverse=True)


def test_what_fits_keeps_its_size_and_what_does_not_is_made_smaller_and_rests_there() -> None:
    k = Kinematics.from_params(GRIPPER)
    settling = replace(SETTLE, fit=True, room_mm=10.0)
    small, large = trimesh.creation.box((0.06, 0.03, 0.03)), trimesh.creation.box((0.19, 0.18, 0.17))
    assert place(small, k, 0.05, PHYSICS, settling, np.random.default_rng(0)).fit_scale == 1
    scales = []
    for seed in range(4):
        placed = place(large, k, 0.05, PHYSICS, settling, np.random.default_rng(seed))
        assert placed.status == RESTING and placed.fit_scale * 0.19 >= 0.05 and placed.fit_scale < 1
        mesh = large.copy().apply_scale(placed.fit_scale)
        assert fitting_pose(apply(placed.T_world_object, surface(mesh)), k, 0.01, PHYSICS.friction) is not None
        world = TableWorld(mesh, PHYSICS)
        world.place_object(placed.T_world_object)
        assert world.lowest_point() == pytest.approx(0, abs=1e-9)
        for _ in range(100):
            world.step()
        assert np.abs(world.object_pose() - placed.T_world_object).max() < 1e-3
        scales.append(placed.fit_scale)
    assert len(set(scales)) == 4
    kept = place(large, k, 0.05, PHYSICS, replace(settling, fit=False), np.random.default_rng(0))
    assert kept.status == RESTING and kept.fit_scale == 1


def test_what_never_fits_says_so() -> None:
    big = trimesh.creation.icosphere(radius=0.08)
    placed = place(big, Kinematics.from_params(JAW), 0.15, PHYSICS, replace(SETTLE, fit=True), np.random.default_rng(0))
    assert placed.status == "no part of it fits the gripper at 15 cm or more" and placed.fit_scale == 1


@pytest.mark.parametrize(
    "extents", [(0.08, 0.05, 0.0003), (0.12, 0.08, 0.002), (0.15, 0.001, 0.001), (0.1, 0.003, 0.002)]
)
def test_cards_and_rods_rest_whatever_their_corners_sink_in(extents: tuple[float, float, float]) -> None:
    settling = replace(SETTLE, fit=False)
    k = Kinematics.from_params(GRIPPER)
    done = [
        place(trimesh.creation.box(extents), k, 0.05, PHYSICS, settling, np.random.default_rng(s)) for s in range(6)
    ]
    assert [one.status for one in done] == [RESTING] * 6
