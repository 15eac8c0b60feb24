"""Objects are placed at rest and between the open fingers, by closed forms and by DART's own collisions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from physics_params import GRIPPER, JAW, PHYSICS, SETTLE

from graspfn.geometry.transforms import translation
from graspfn.meshes.placed import RESTING, Resting
from graspfn.params import Gripper
from graspfn.physics.fitting import largest_scale, place
from graspfn.physics.gripper import Kinematics
from graspfn.physics.world import GraspWorld, TableWorld

GRIPPERS = pytest.mark.parametrize("gripper", [GRIPPER, JAW], ids=["revolute", "prismatic"])


def standing(extents: tuple[float, float, float]) -> tuple[trimesh.Trimesh, np.ndarray]:
    return trimesh.creation.box(extents), translation(0, 0, extents[2] / 2)


@GRIPPERS
@pytest.mark.parametrize("extents", [(0.05, 0.02, 0.01), (0.02, 0.2, 0.04), (0.06, 0.06, 0.2)])
def test_the_largest_box_that_fits_has_its_closed_form(gripper: Gripper, extents: tuple[float, float, float]) -> None:
    k = Kinematics.from_params(gripper)
    gap, lean = k.gap()
    x, y, z = extents
    expected = min((gap - 0.01) / (min(x, y) + 2 * lean * z), k.height / z)
    assert largest_scale(*standing(extents), k, 0.01) == pytest.approx(expected, rel=1e-9)


@GRIPPERS
def test_open_fingers_clear_what_fits_and_touch_what_is_larger(gripper: Gripper) -> None:
    # Of a wedge, narrow below: the leaning faces of the fingers decide, at the height of its broad top.
    points = np.array([[x * (0.5 + z / 0.08), y, z] for x in (-0.03, 0.03) for y in (-0.09, 0.09) for z in (0, 0.04)])
    wedge = trimesh.convex.convex_hull(points)
    scale = largest_scale(wedge, np.eye(4), Kinematics.from_params(gripper), 0.0)
    for factor, touches in ((0.995, False), (1.005, True)):
        mesh = wedge.copy().apply_scale(scale * factor)
        world = GraspWorld(Resting(mesh, mesh, np.eye(4)), PHYSICS, gripper)
        world.place_object(np.eye(4))
        world.place_hand(np.zeros(3))
        assert world.hand_touches_object() is touches


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
        assert largest_scale(mesh, placed.T_world_object, k, 0.01) >= 1 - 1e-9
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


def test_what_never_fits_says_at_which_size_it_would() -> None:
    big = trimesh.creation.icosphere(radius=0.08)
    placed = place(big, Kinematics.from_params(JAW), 0.05, PHYSICS, replace(SETTLE, fit=True), np.random.default_rng(0))
    assert placed.status.startswith("too large for the gripper: it would fit at 4.") and placed.fit_scale == 1


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
