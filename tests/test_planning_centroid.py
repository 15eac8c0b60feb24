"""The Centroid baseline on boxes whose top faces are drawn analytically."""

from __future__ import annotations

import numpy as np
import pytest

from graspfn.geometry import grid
from graspfn.imaging.camera import Intrinsics
from graspfn.planning.centroid import centroid_grasp, object_mask

CAMERA = Intrinsics(640, 480, 570.0)


def box(u: float, v: float, theta: float, length: float, width: float, height: float) -> np.ndarray:
    """Depth image (480, 640) of a box whose long side points along theta: ray against slabs in the box's own axes."""
    rays = CAMERA.rays()
    c, s = np.cos(theta), np.sin(theta)
    turn = np.array([[c, -s, 0], [-s, -c, 0], [0, 0, 1]])  # rows: long side, short side (world: v is -y), up
    origin = turn @ (np.array([0, 0, CAMERA.table_depth]) - [u, -v, height / 2])
    direction = rays @ turn.T
    half = np.array([length, width, height]) / 2
    with np.errstate(divide="ignore"):
        one, other = (-half - origin) / direction, (half - origin) / direction
    enter, leave = np.minimum(one, other).max(axis=-1), np.maximum(one, other).min(axis=-1)
    return np.where(enter < leave, enter, CAMERA.table_depth)


@pytest.mark.parametrize("height", [0.02, 0.1])
@pytest.mark.parametrize(("u", "v", "theta"), [(0, 0, 0), (0.06, -0.04, 0.5), (-0.08, 0.05, 2.0), (0.05, 0.07, 3.0)])
def test_the_grasp_follows_the_object(u, v, theta, height):
    q = centroid_grasp(box(u, v, theta, 0.12, 0.04, height), CAMERA)
    np.testing.assert_allclose(q[:2], [u, v], atol=0.0025)
    across = (theta + np.pi / 2) % np.pi
    assert abs(grid.angle_difference(q[2], across)) < np.radians(2)
    assert 0 <= q[2] < np.pi


def test_a_centroid_of_pixels_would_miss_a_tall_object():
    depth = box(0.1, 0.06, 0.3, 0.05, 0.05, 0.15)
    rows, columns = np.nonzero(object_mask(depth, CAMERA))
    naive = CAMERA.pixel_to_table(np.array([columns.mean(), rows.mean()]))
    assert np.hypot(*(naive - [0.1, 0.06])) > 0.02
    assert np.hypot(*(centroid_grasp(depth, CAMERA)[:2] - [0.1, 0.06])) < 0.005


def test_depth_noise_does_not_move_the_grasp():
    depth = box(0.05, -0.03, 0.8, 0.1, 0.03, 0.02)
    noisy = depth + np.random.default_rng(0).normal(0, 0.0015, depth.shape)
    clean = centroid_grasp(depth, CAMERA)
    q = centroid_grasp(noisy, CAMERA)
    np.testing.assert_allclose(q[:2], clean[:2], atol=0.001)
    assert abs(grid.angle_difference(q[2], clean[2])) < np.radians(1)


def test_noise_on_an_empty_table_is_no_object_and_no_grasp():
    depth = CAMERA.table_depth + np.random.default_rng(1).normal(0, 0.0015, (480, 640))
    assert not object_mask(depth, CAMERA).any()
    assert centroid_grasp(depth, CAMERA) is None


def test_specks_are_left_out_and_large_pieces_kept():
    two = np.minimum(box(-0.06, 0, 0, 0.03, 0.03, 0.03), box(0.06, 0, 0, 0.03, 0.03, 0.03))
    speck = two.copy()
    speck[20:24, 20:24] -= 0.05
    q = centroid_grasp(speck, CAMERA)
    np.testing.assert_allclose(q, centroid_grasp(two, CAMERA), atol=1e-12)
    np.testing.assert_allclose(q, [0, 0, np.pi / 2], atol=0.002)


def test_over_placements_the_centroid_has_no_bias():
    """The patches' raster gives or takes a part of their 2 mm anywhere, and on average nothing."""
    rng = np.random.default_rng(2)
    errors = []
    for u, v in rng.uniform(-0.05, 0.05, (20, 2)):
        errors.append(centroid_grasp(box(u, v, 0.3, 0.08, 0.05, 0.01), CAMERA)[:2] - [u, v])
    assert np.all(abs(np.mean(errors, axis=0)) < 0.0003)


@pytest.mark.parametrize(("height", "seen"), [(0.006, True), (0.004, False)])
def test_what_is_lower_than_5_mm_is_taken_for_table(height, seen):
    assert object_mask(box(0, 0, 0, 0.05, 0.05, height), CAMERA).any() == seen


@pytest.mark.parametrize(("side", "kept"), [(0.32, True), (0.30, False)])
def test_a_piece_of_a_tenth_of_the_largest_belongs_to_the_object(side, kept):
    depth = np.full((480, 640), CAMERA.table_depth)
    depth[100:200, 100:200] -= 0.05
    depth[300 : 300 + round(100 * side), 300 : 300 + round(100 * side)] -= 0.05
    assert object_mask(depth, CAMERA)[310, 310] == kept


def test_pieces_that_touch_at_a_corner_are_one():
    depth = np.full((480, 640), CAMERA.table_depth)
    depth[100:200, 100:200] -= 0.05
    depth[200:220, 200:220] -= 0.05
    assert object_mask(depth, CAMERA)[210, 210]
