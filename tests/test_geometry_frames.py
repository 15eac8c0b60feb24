"""The pose grid, the camera and the frames of the world agree with each other and with their conventions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from graspfn.geometry import grid
from graspfn.geometry.transforms import T_world_grasp, T_world_scene, apply, move_pose, unmove_pose
from graspfn.imaging.camera import Camera
from graspfn.params import read_yaml, validate

ROOT = Path(__file__).parents[1]
CAMERA = Camera.of_the_paper(640, 480, 570.0)


def random_poses(n: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.column_stack([rng.uniform(-0.2, 0.2, (n, 2)), rng.uniform(0, np.pi, n)])


def test_q_is_44_by_33_positions_10_mm_apart_at_6_angles_about_the_image_centre():
    q = grid.poses()
    assert q.shape == (33, 44, 6, 3)
    np.testing.assert_allclose(np.diff(q[..., 0], axis=1), 0.01)
    np.testing.assert_allclose(np.diff(q[..., 1], axis=0), 0.01)
    np.testing.assert_allclose(np.diff(q[..., 2], axis=2), np.pi / 6)
    np.testing.assert_allclose(q[0, 0, 0], [-0.215, -0.16, 0])
    np.testing.assert_allclose(q[..., :2], -q[::-1, ::-1, :, :2], atol=1e-15)


def test_poses_and_indices_are_each_others_inverse():
    index = np.moveaxis(np.indices(grid.SHAPE), 0, -1)
    np.testing.assert_allclose(grid.from_index(index), grid.poses(), atol=1e-15)
    np.testing.assert_allclose(grid.to_index(grid.poses()), index, atol=1e-12)
    q = random_poses(50)
    np.testing.assert_allclose(grid.from_index(grid.to_index(q)), q, atol=1e-15)


def test_draws_fill_every_cell_evenly():
    index = np.moveaxis(np.indices((*grid.SHAPE, 4)), 0, -1)[..., :3]
    offset = grid.to_index(grid.sample_cells(4, np.random.default_rng(0))) - index
    assert offset.shape == (*grid.SHAPE, 4, 3)
    draws = offset.reshape(-1, 3)
    assert all(stats.kstest(axis, "uniform", (-0.5, 1)).pvalue > 1e-4 for axis in draws.T)
    assert np.all(abs(np.corrcoef(draws.T) - np.eye(3)) < 5 / np.sqrt(len(draws)))
    repeats = np.corrcoef(offset[..., 0].reshape(-1, 4).T)
    assert np.all(abs(repeats - np.eye(4)) < 5 * np.sqrt(4 / len(draws)))


def test_the_difference_of_two_jaw_directions_is_the_smallest():
    a, b = np.random.default_rng(1).uniform(-10, 10, (2, 500))
    difference = grid.angle_difference(a, b)
    turns = (a - b - difference) / np.pi
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
    assert np.all((difference >= -np.pi / 2) & (difference < np.pi / 2))
    assert grid.angle_difference(np.pi / 2, 0.0) == -np.pi / 2
    assert grid.angle_difference(0.1, np.pi - 0.1) == pytest.approx(0.2)


def test_the_camera_is_the_one_of_the_parameters():
    camera = Camera.from_params(validate(read_yaml(ROOT / "params.yaml")).camera)
    assert (camera.width, camera.height, camera.K, camera.distortion) == (640, 480, CAMERA.K, ())
    np.testing.assert_allclose(camera.T_world_camera, CAMERA.T_world_camera, atol=1e-15)


def test_14_pixels_of_the_table_are_10_mm_and_its_middle_is_the_images():
    np.testing.assert_allclose(CAMERA.table_to_pixel([0.0, 0.0]), [319.5, 239.5])
    np.testing.assert_allclose(CAMERA.table_to_pixel([0.01, -0.02]), [333.5, 211.5])
    pixels = np.random.default_rng(2).uniform(0, 480, (50, 2))
    np.testing.assert_allclose(CAMERA.table_to_pixel(CAMERA.pixel_to_table(pixels)), pixels)


def test_what_a_pixel_sees_projects_back_into_it():
    """By K, in the camera's axes: x as the world's, y and z the other way, from `table_depth` above the table."""
    depth = np.random.default_rng(3).uniform(0.2, CAMERA.table_depth, (480, 640))
    seen = (CAMERA.deproject(depth) - [0, 0, CAMERA.table_depth]) * [1, -1, -1]
    np.testing.assert_allclose(seen[..., 2], depth)
    x, y, one = np.moveaxis(seen @ CAMERA.matrix.T / depth[..., None], -1, 0)
    rows, columns = np.mgrid[:480, :640]
    np.testing.assert_allclose(x, columns, atol=1e-9)
    np.testing.assert_allclose(y, rows, atol=1e-9)
    np.testing.assert_allclose(one, 1)


def test_pixels_of_the_bare_table_see_the_points_they_lie_over():
    seen = CAMERA.deproject(np.full((480, 640), CAMERA.table_depth))
    rows, columns = np.mgrid[:480, :640]
    uv = CAMERA.pixel_to_table(np.stack([columns, rows], axis=-1))
    np.testing.assert_allclose(seen, np.stack([uv[..., 0], -uv[..., 1], np.zeros((480, 640))], axis=-1), atol=1e-12)


def test_jaws_close_along_theta_as_the_image_shows_it():
    """From the pose along +u turned towards +v, which is down in the image and -y in the world."""
    for u, v, theta in random_poses(20):
        T = T_world_grasp(np.array([u, v, theta]))
        step = apply(T, np.array([[0.0, 0, 0], [0.01, 0, 0], [0, 0, 0.01]]))
        np.testing.assert_allclose(step[0], [u, -v, 0], atol=1e-15)
        np.testing.assert_allclose(step[1] - step[0], [0.01 * np.cos(theta), -0.01 * np.sin(theta), 0], atol=1e-15)
        np.testing.assert_allclose(step[2] - step[0], [0, 0, 0.01], atol=1e-15)
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1)


def test_a_pose_that_moves_with_the_object_is_the_grippers_frame_in_the_moved_scene():
    """Up to the half turn that means nothing to a parallel jaw."""
    shift, theta = np.array([0.03, -0.07]), 2.5
    half_turn = np.diag([-1.0, -1, 1, 1])
    for q in random_poses(20):
        moved = move_pose(q, shift, theta)
        assert 0 <= moved[2] < np.pi
        T, expected = T_world_grasp(moved), T_world_scene(shift, theta) @ T_world_grasp(q)
        assert np.allclose(T, expected) or np.allclose(T @ half_turn, expected)


def test_moving_back_is_the_inverse_of_moving():
    q, shift, theta = random_poses(200), np.array([0.03, -0.07]), 5.8
    back = unmove_pose(move_pose(q, shift, theta), shift, theta)
    np.testing.assert_allclose(back[:, :2], q[:, :2], atol=1e-15)
    np.testing.assert_allclose(grid.angle_difference(back[:, 2], q[:, 2]), 0, atol=1e-12)
