"""A grasp function and its image move with the object."""

import numpy as np
import pytest
from scipy import ndimage

from graspfn.geometry.grid import CELL_M, CELL_PX, CELL_RAD, SHAPE, poses
from graspfn.geometry.transforms import T_world_scene, apply, move_pose
from graspfn.imaging.camera import Camera
from graspfn.imaging.warp import move_function, move_image, sample_function

CAMERA = Camera.of_the_paper(640, 480, 570.0)
STILL = np.zeros(2)


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def smooth_function(rng):
    """(33, 44, 6): bumps in the middle of Q that bilinear interpolation follows well; periodic in theta."""
    centres = np.column_stack([rng.uniform(-0.06, 0.06, (5, 2)), rng.uniform(0, np.pi, 5)])
    q = poses()
    f = np.zeros(SHAPE)
    for u, v, theta in centres:
        distance = (q[..., 0] - u) ** 2 + (q[..., 1] - v) ** 2
        f += np.exp(-distance / 0.035**2) * (1.5 + np.cos(2 * (q[..., 2] - theta)))
    return f


def test_sampling_at_the_grid_returns_the_function(rng):
    f = rng.random((*SHAPE, 2))
    assert np.allclose(sample_function(f, poses()), f, atol=1e-12)


def test_sampling_is_trilinear_and_wraps_in_theta(rng):
    f = rng.random(SHAPE)
    q = poses()[10, 20, 5]
    half = sample_function(f, q + np.array([CELL_M, CELL_M, CELL_RAD]) / 2)
    assert np.isclose(half, f[10:12, 20:22][:, :, [5, 0]].mean())
    assert np.isclose(sample_function(f, q + np.array([0, 0, np.pi])), f[10, 20, 5])


def test_sampling_agrees_with_scipy(rng):
    f = rng.random(SHAPE)
    q = np.column_stack([rng.uniform(-0.25, 0.25, (500, 2)), rng.uniform(-1, 7, 500)])
    index = [q[:, 1] / CELL_M + 16, q[:, 0] / CELL_M + 21.5, (q[:, 2] / CELL_RAD) % 6 + 6]
    tiled = np.tile(f, (1, 1, 3))
    expected = ndimage.map_coordinates(tiled, index, order=1, mode="grid-constant")
    assert np.allclose(sample_function(f, q), expected)


def test_no_grasp_outside_q(rng):
    f = rng.random(SHAPE) + 1
    assert sample_function(f, np.array([0.23, 0.0, 0.1])) == 0
    assert sample_function(f, np.array([0.0, -0.18, 0.1])) == 0


@pytest.mark.parametrize("cells", [(3, 0), (0, -4), (-5, 7)])
def test_shifts_by_whole_cells_are_exact(rng, cells):
    f = np.zeros(SHAPE)
    f[10:23, 10:30] = rng.random((13, 20, 6))
    moved = move_function(f, np.array(cells) * CELL_M, 0.0)
    assert np.allclose(moved, np.roll(f, cells[::-1], axis=(0, 1)), atol=1e-9)


@pytest.mark.parametrize("turns", range(1, 7))
def test_turns_by_whole_cells_only_roll_theta_at_the_centre(turns):
    """At the centre of Q a turn of k * 30 degrees takes direction j to j + k."""
    f = np.broadcast_to(np.arange(6.0), SHAPE)
    moved = move_function(f, STILL, turns * CELL_RAD)
    assert np.allclose(moved[16, 19:25], np.roll(np.arange(6.0), turns), atol=1e-9)


def test_a_half_turn_is_a_point_reflection(rng):
    f = rng.random(SHAPE)
    assert np.allclose(move_function(f, STILL, np.pi), f[::-1, ::-1], atol=1e-9)


def test_a_quarter_turn_takes_every_grasp_with_it(rng):
    """-u goes to -v: axes swap, and theta moves on by three cells."""
    f = np.zeros((*SHAPE,))
    f[4:29, 10:34] = rng.random((25, 24, 6))
    moved = move_function(f, STILL, np.pi / 2)
    for index in [(10, 12, 0), (20, 30, 4), (5, 20, 5)]:
        assert np.isclose(sample_function(moved, move_pose(poses()[index], STILL, np.pi / 2)), sample_at_half(f, index))


def sample_at_half(f, index):
    """A quarter turn takes rows (odd count) between columns (even count): the moved grid lies half a cell off, and
    reading it back there averages the four corners round the pose twice over."""
    v, u, k = index
    weights = np.outer([0.25, 0.5, 0.25], [0.25, 0.5, 0.25])
    return (f[v - 1 : v + 2, u - 1 : u + 2, k] * weights).sum()


def test_moved_function_has_the_value_of_the_pose_it_came_from(rng):
    f = smooth_function(rng)
    shift, theta = np.array([0.023, -0.031]), 0.7
    q = poses()[8:25, 12:32]
    error = sample_function(move_function(f, shift, theta), move_pose(q, shift, theta)) - f[8:25, 12:32]
    assert np.abs(error).max() < 0.15 * f.max()
    assert np.abs(error).mean() < 0.05 * f.max()


def test_two_motions_make_one(rng):
    f = smooth_function(rng)
    (shift_a, a), (shift_b, b) = (np.array([0.02, 0.01]), np.pi / 6), (np.array([-0.03, 0.02]), np.pi / 3)
    both = move_pose(np.array([*shift_a, 0.0]), shift_b, b)[:2]
    one, two = move_function(f, both, a + b), move_function(move_function(f, shift_a, a), shift_b, b)
    assert np.abs(one - two).max() < 0.05 * f.max()


def test_there_and_back(rng):
    f = smooth_function(rng)
    shift, theta = np.array([0.02, -0.03]), np.pi / 6
    back = move_pose(np.array([*-shift, 0.0]), STILL, -theta)[:2]
    assert np.abs(move_function(move_function(f, shift, theta), back, -theta) - f).max() < 0.05 * f.max()


def test_image_moves_as_the_scene_does():
    """A blob at a point of the table lands where T_world_scene takes the point."""
    point, shift, theta = np.array([0.05, -0.03]), np.array([-0.02, 0.06]), 2.0
    x, y = CAMERA.table_to_pixel(point)
    rows, columns = np.mgrid[:480, :640]
    blob = np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / 50)
    moved = move_image(blob, shift, theta, CAMERA, 0.0)
    found = CAMERA.pixel_to_table(np.array(ndimage.center_of_mass(moved))[::-1])
    world = apply(T_world_scene(shift, theta), np.array([point[0], -point[1], 0.0]))
    assert np.allclose(found, [world[0], -world[1]], atol=1e-5)


def test_image_moves_by_whole_cells_exactly(rng):
    depth = rng.random((480, 640)).astype(np.float32)
    moved = move_image(depth, np.array([2 * CELL_M, -CELL_M]), 0.0, CAMERA, 0.4)
    assert moved.dtype == np.float32
    assert np.allclose(moved[:466, 28:], depth[14:, :612], atol=1e-6)
    assert np.allclose(moved[:, :27], 0.4)
    assert np.allclose(moved[467:], 0.4)


def test_between_pixels_an_image_is_the_mean_of_its_neighbours(rng):
    depth = rng.random((480, 640))
    moved = move_image(depth, np.array([0.5, 0.25]) * CELL_M / CELL_PX, 0.0, CAMERA, 0.4)
    across = (depth[:, 1:] + depth[:, :-1]) / 2
    assert np.allclose(moved[1:, 1:], 0.75 * across[1:] + 0.25 * across[:-1], atol=1e-9)


def test_image_turns_half_round_exactly(rng):
    depth = rng.random((480, 640))
    assert np.allclose(move_image(depth, STILL, np.pi, CAMERA, 0.4), depth[::-1, ::-1], atol=1e-9)
