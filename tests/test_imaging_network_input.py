"""The network's input: heights, on four pixels a side per cell of Q."""

import numpy as np
import pytest

from graspfn.geometry.grid import axes
from graspfn.imaging.camera import Camera
from graspfn.imaging.network_input import INPUT_SHAPE, area_average, depth_input

CAMERA = Camera.of_the_paper(640, 480, 570.0)


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_table_is_zero_and_10_cm_is_one():
    table = np.full((480, 640), CAMERA.table_depth, np.float32)
    assert np.allclose(depth_input(table, CAMERA), 0, atol=1e-6)
    assert np.allclose(depth_input(table - np.float32(0.1), CAMERA), 1, atol=1e-5)


def test_area_average_agrees_with_halving_every_pixel(rng):
    """Each pixel doubled each way makes every mean one of 7 x 7 whole pixels."""
    crop = rng.random((2, 462, 616))
    doubled = crop.repeat(2, axis=-2).repeat(2, axis=-1)
    slow = doubled.reshape(2, 132, 7, 176, 7).mean(axis=(2, 4))
    assert np.allclose(area_average(crop), slow)


def test_mean_height_is_kept(rng):
    crop = rng.random((462, 616))
    assert area_average(crop).mean() == pytest.approx(crop.mean())


def test_a_cell_of_q_is_its_own_four_by_four_pixels(rng):
    """Just what lies in the 10 mm square round a pose's centre is in input[4 v : 4 v + 4, 4 u : 4 u + 4]."""
    v, u, _ = axes()
    y, x = np.mgrid[:480, :640]
    table = CAMERA.pixel_to_table(np.stack([x, y], axis=-1))
    for i, j in [(0, 0), (16, 20), (32, 43)]:
        cell = (np.abs(table[..., 0] - u[j]) < 0.005) & (np.abs(table[..., 1] - v[i]) < 0.005)
        assert cell.sum() == 14 * 14
        seen = depth_input(CAMERA.table_depth - 0.1 * cell, CAMERA)
        assert seen.shape == INPUT_SHAPE
        assert np.allclose(seen[4 * i : 4 * i + 4, 4 * j : 4 * j + 4], 1, atol=1e-5)
        assert seen.sum() == pytest.approx(16, abs=1e-2)


def test_batches_are_images_side_by_side(rng):
    depth = rng.uniform(0.3, 0.4, (2, 3, 480, 640))
    batch = depth_input(depth, CAMERA)
    assert batch.dtype == np.float32
    assert np.allclose(batch[1, 2], depth_input(depth[1, 2], CAMERA))


def test_larger_cameras_are_cropped_round_the_centre(rng):
    depth = rng.uniform(0.3, 0.4, (500, 700)).astype(np.float32)
    large, small = Camera.of_the_paper(700, 500, 570.0), Camera.of_the_paper(616, 462, 570.0)
    assert np.array_equal(depth_input(depth, large), depth_input(depth[19:-19, 42:-42], small))


@pytest.mark.parametrize(("width", "height", "key"), [(641, 480, "width_px"), (640, 460, "height_px")])
def test_a_camera_that_q_does_not_fit_is_one_line(width, height, key):
    with pytest.raises(ValueError, match=rf"^camera.{key}: .*$"):
        depth_input(np.ones((height, width)), Camera.of_the_paper(width, height, 570.0))


def test_an_image_of_another_size_is_one_line():
    with pytest.raises(ValueError, match=r"^depth image: is 320x240 pixels; the camera's are 640x480$"):
        depth_input(np.ones((240, 320)), CAMERA)
