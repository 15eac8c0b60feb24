"""Eq. 2 against closed forms."""

import numpy as np
import pytest
from scipy.stats import norm

from graspfn.imaging.noise import add_noise
from graspfn.params import Noise

SHAPE = (480, 640)
INNER = np.s_[10:-10, 10:-10]


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_without_noise_nothing_changes(rng):
    depth = rng.random(SHAPE).astype(np.float32)
    assert np.array_equal(add_noise(depth, Noise(0.0, 0.0), rng), depth)


def test_flat_plane_has_the_depth_error_alone(rng):
    noisy = add_noise(np.full(SHAPE, 0.4), Noise(1.0, 1.5), rng)
    assert noisy.dtype == np.float32
    assert noisy.std() == pytest.approx(0.0015, rel=0.01)
    assert noisy.mean() == pytest.approx(0.4, abs=2e-5)
    assert np.quantile(noisy, norm.cdf(3)) - 0.4 == pytest.approx(3 * 0.0015, rel=0.05)


@pytest.mark.parametrize("slope", [(0.001, 0.0), (0.0, 0.002), (0.0015, -0.001)])
def test_slanted_plane_turns_jitter_into_depth(rng, slope):
    """Independent errors add in quadrature: std^2 = sd^2 + |slope|^2 sp^2, with no rounding to whole pixels."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    plane = 0.3 + slope[0] * columns + slope[1] * rows
    error = (add_noise(plane, Noise(1.0, 1.5), rng) - plane)[INNER]
    assert error.std() == pytest.approx(np.hypot(0.0015, np.hypot(*slope)), rel=0.01)
    assert error.mean() == pytest.approx(0, abs=3e-5)


def test_neighbouring_pixels_err_independently(rng):
    error = add_noise(np.full(SHAPE, 0.4), Noise(1.0, 1.5), rng) - 0.4
    assert abs(np.corrcoef(error[:, 1:].ravel(), error[:, :-1].ravel())[0, 1]) < 0.01
    assert abs(np.corrcoef(error[1:].ravel(), error[:-1].ravel())[0, 1]) < 0.01


@pytest.mark.parametrize("sigma", [0.7, 1.0, 2.0])
def test_step_edge_is_crossed_as_often_as_a_gaussian_reaches_over_it(rng, sigma):
    """Column d before the step reads E[clip(N(d, sp) + 1, 0, 1)] of it, the ramp between two pixels being linear."""
    step = np.zeros(SHAPE)
    step[:, 320:] = 1.0
    noisy = add_noise(step, Noise(sigma, 0.0), rng)
    draws = np.linspace(-8, 8, 20001)
    for column in range(315, 325):
        read = np.clip(column + sigma * draws - 319, 0, 1)
        expected = np.trapezoid(read * norm.pdf(draws), draws)
        assert noisy[:, column].mean() == pytest.approx(expected, abs=4 * 0.5 / np.sqrt(SHAPE[0]))


def test_same_generator_same_noise():
    depth = np.linspace(0.3, 0.4, SHAPE[0] * SHAPE[1]).reshape(SHAPE)
    one, two, other = (add_noise(depth, Noise(1.0, 1.5), np.random.default_rng(seed)) for seed in (3, 3, 4))
    assert np.array_equal(one, two)
    assert not np.array_equal(one, other)
