"""Heights from straight above: closed forms, and the map of a moved object is the moved map."""

import numpy as np
import pytest
import trimesh

from graspfn.geometry.transforms import T_world_scene, rotation_z, translation
from graspfn.imaging.orthographic import FINE_M, FINE_SHAPE, render_heights


def centres():
    """u (352,) and v (264, 1) of the cells."""
    v, u = ((np.arange(n) - (n - 1) / 2) * FINE_M for n in FINE_SHAPE)
    return u, v[:, None]


def test_a_box_is_its_footprint_at_its_height():
    u, v = centres()
    box = trimesh.creation.box((0.151, 0.061, 0.05))
    heights = render_heights(box, translation(0.02, 0.01, 0.025))
    inside = (np.abs(u - 0.02) < 0.0755) & (np.abs(v + 0.01) < 0.0305)  # y is -v
    assert heights.dtype == np.float32
    assert heights == pytest.approx(np.where(inside, 0.05, 0), abs=1e-6)


def test_a_ball_is_a_sphere_without_parallax():
    u, v = centres()
    ball = trimesh.creation.icosphere(5, 0.04)
    heights = render_heights(ball, translation(0.15, -0.1, 0.04))
    r2 = (u - 0.15) ** 2 + (v - 0.1) ** 2
    inside = r2 < 0.035**2
    assert heights[inside] == pytest.approx((0.04 + np.sqrt(0.04**2 - r2[inside])), abs=2e-4)
    assert not heights[r2 > 0.04**2].any()


def test_a_move_by_whole_cells_and_a_half_turn_move_the_map():
    cup = trimesh.creation.annulus(0.02, 0.03, 0.05)
    T = translation(0, 0, 0.025) @ np.diag([1, -1, -1, 1.0])
    here = render_heights(cup, translation(0.02, 0, 0) @ T)
    moved = render_heights(cup, T_world_scene(np.array([16, 8]) * FINE_M, 0.0) @ translation(0.02, 0, 0) @ T)
    turned = render_heights(cup, rotation_z(np.pi) @ translation(0.02, 0, 0) @ T)
    assert moved == pytest.approx(np.roll(here, (8, 16), axis=(0, 1)), abs=1e-6)
    assert (np.abs(turned - here[::-1, ::-1]) > 1e-6).sum() <= 4  # rays through the very edge of a cell


@pytest.mark.parametrize("shift", [(1.0, 0.0), (0.0, -1.0), (-0.3, 0.3)])
def test_what_lies_beside_q_is_not_in_it(shift):
    assert not render_heights(trimesh.creation.box((0.1, 0.1, 0.1)), translation(*shift, 0.05)).any()


def test_what_is_cut_by_the_border_is_there_up_to_it():
    heights = render_heights(trimesh.creation.box((0.1, 0.1, 0.1)), translation(0.22, 0, 0.05))
    assert heights[132, -40:] == pytest.approx(0.1)
    assert not heights[132, :-41].any()
