"""The Centroid baseline on height maps of boxes whose faces are drawn analytically."""

from __future__ import annotations

import numpy as np
import pytest

from graspfn.geometry import grid
from graspfn.imaging.camera import Camera
from graspfn.imaging.height_map import HeightMap, height_map
from graspfn.planning.centroid import centroid_grasp, object_mask

CAMERA = Camera.of_the_paper(640, 480, 570.0)


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


def grasp(depth: np.ndarray) -> np.ndarray | None:
    return centroid_grasp(height_map(depth, CAMERA))


@pytest.mark.parametrize("height", [0.02, 0.1])
@pytest.mark.parametrize(("u", "v", "theta"), [(0, 0, 0), (0.06, -0.04, 0.5), (-0.08, 0.05, 2.0), (0.05, 0.07, 3.0)])
def test_the_grasp_follows_the_object(u, v, theta, height):
    q = grasp(box(u, v, theta, 0.12, 0.04, height))
    np.testing.assert_allclose(q[:2], [u, v], atol=0.0025)
    across = (theta + np.pi / 2) % np.pi
    assert abs(grid.angle_difference(q[2], across)) < np.radians(2)
    assert 0 <= q[2] < np.pi


def test_a_centroid_of_pixels_would_miss_a_tall_object():
    depth = box(0.1, 0.06, 0.3, 0.05, 0.05, 0.15)
    rows, columns = np.nonzero(CAMERA.deproject(depth)[..., 2] > 0.005)
    naive = CAMERA.pixel_to_table(np.array([columns.mean(), rows.mean()]))
    assert np.hypot(*(naive - [0.1, 0.06])) > 0.02
    assert np.hypot(*(grasp(depth)[:2] - [0.1, 0.06])) < 0.005


def test_depth_noise_does_not_move_the_grasp():
    depth = box(0.05, -0.03, 0.8, 0.1, 0.03, 0.02)
    noisy = depth + np.random.default_rng(0).normal(0, 0.0015, depth.shape)
    clean, q = grasp(depth), grasp(noisy)
    np.testing.assert_allclose(q[:2], clean[:2], atol=0.001)
    assert abs(grid.angle_difference(q[2], clean[2])) < np.radians(1)


def test_noise_on_an_empty_table_is_no_object_and_no_grasp():
    depth = CAMERA.table_depth + np.random.default_rng(1).normal(0, 0.0015, (480, 640))
    assert grasp(depth) is None


def test_specks_are_left_out_and_large_pieces_kept():
    two = np.minimum(box(-0.06, 0, 0, 0.03, 0.03, 0.03), box(0.06, 0, 0, 0.03, 0.03, 0.03))
    speck = two.copy()
    speck[20:24, 20:24] -= 0.05
    q = grasp(speck)
    np.testing.assert_allclose(q, grasp(two), atol=1e-12)
    np.testing.assert_allclose(q, [0, 0, np.pi / 2], atol=0.002)


def test_over_placements_the_centroid_has_no_bias():
    """The cells' raster gives or takes a part of their 2.5 mm anywhere, and on average nothing."""
    rng = np.random.default_rng(2)
    errors = []
    for u, v in rng.uniform(-0.05, 0.05, (20, 2)):
        errors.append(grasp(box(u, v, 0.3, 0.08, 0.05, 0.01))[:2] - [u, v])
    assert np.all(abs(np.mean(errors, axis=0)) < 0.0003)


@pytest.mark.parametrize(("height", "seen"), [(0.006, True), (0.004, False)])
def test_what_is_lower_than_5_mm_is_taken_for_table(height, seen):
    assert object_mask(height_map(box(0, 0, 0, 0.05, 0.05, height), CAMERA)).any() == seen


def raised(*squares: tuple[int, int, int]) -> HeightMap:
    """A map with squares, (row, column, side) in cells, 5 cm over the table."""
    heights = np.zeros((132, 176), np.float32)
    for row, column, side in squares:
        heights[row : row + side, column : column + side] = 0.05
    return HeightMap(heights, np.ones_like(heights, dtype=bool))


@pytest.mark.parametrize(("side", "kept"), [(13, True), (12, False)])
def test_a_piece_of_a_tenth_of_the_largest_belongs_to_the_object(side, kept):
    assert object_mask(raised((20, 20, 40), (100, 120, side)))[105, 125] == kept


def test_pieces_that_touch_at_a_corner_are_one():
    assert object_mask(raised((20, 20, 40), (60, 60, 5)))[62, 62]
