"""Filled holes, against the definition read pixel by pixel, and on images of real cameras."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from graspfn.imaging.holes import fill_holes

REAL = Path(__file__).parents[1] / "../shared/data/depth"


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def check_against_definition(depth, filled, radius, pixels):
    """Every one of the hole pixels: the mean of the valid ones within the radius, else one of the nearest."""
    rows, columns = np.nonzero(np.isfinite(depth) & (depth > 0))
    values = depth[rows, columns].astype(float)
    for row, column in pixels:
        distance2 = (rows - row) ** 2 + (columns - column) ** 2
        if (distance2 <= radius**2).any():
            assert filled[row, column] == pytest.approx(values[distance2 <= radius**2].mean(), rel=1e-6)
        else:
            nearest = values[distance2 == distance2.min()]
            assert np.abs(nearest - filled[row, column]).min() < 1e-6


@pytest.mark.parametrize("radius", [1.0, 2.5, 5.0, 60.0])
@pytest.mark.parametrize("share", [0.1, 0.6, 0.995])
def test_agrees_with_the_definition(rng, radius, share):
    depth = rng.uniform(0.3, 0.5, (40, 50)).astype(np.float32)
    depth[rng.random(depth.shape) < share] = 0
    depth[5:20, 10:30] = np.nan
    filled = fill_holes(depth, radius)
    valid = depth > 0
    assert np.array_equal(filled[valid], depth[valid])
    check_against_definition(depth, filled, radius, np.argwhere(~valid)[::7])


def test_whole_image_stays(rng):
    depth = rng.uniform(0.3, 0.5, (48, 64)).astype(np.float32)
    assert np.array_equal(fill_holes(depth), depth)


def test_zero_nan_and_infinity_are_all_holes():
    depth = np.full((48, 64), 0.4, np.float32)
    depth[10, 10], depth[20, 20], depth[30, 30], depth[40, 40] = 0, np.nan, np.inf, -1
    assert np.allclose(fill_holes(depth), 0.4)


def test_filling_twice_is_filling_once(rng):
    depth = rng.uniform(0.3, 0.5, (48, 64))
    depth[rng.random(depth.shape) < 0.5] = 0
    assert np.array_equal(fill_holes(fill_holes(depth)), fill_holes(depth))


def test_one_valid_pixel_fills_the_image():
    depth = np.zeros((48, 64))
    depth[3, 60] = 0.37
    assert np.allclose(fill_holes(depth), 0.37)


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_nothing_valid_is_one_line(value):
    with pytest.raises(ValueError, match=r"^depth image: every pixel is zero or NaN.*$"):
        fill_holes(np.full((48, 64), value))


@pytest.mark.skipif(not REAL.exists(), reason="no real depth images beside the repository")
def test_real_images(rng):
    paths = sorted(REAL.rglob("*depth.png"))
    assert paths
    for path in paths:
        with Image.open(path) as image:
            depth = np.asarray(image).astype(np.float32) * 1e-4
        filled = fill_holes(depth)
        valid = depth > 0
        assert (filled > 0).all()
        assert np.array_equal(filled[valid], depth[valid])
        assert filled.max() <= depth.max()
        assert filled.min() >= depth[valid].min()
        check_against_definition(depth, filled, 5.0, rng.permutation(np.argwhere(~valid))[:20])
