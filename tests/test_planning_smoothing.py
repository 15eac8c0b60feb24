"""The robust grasp function against Monte Carlo, closed forms and its limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.ndimage import map_coordinates
from scipy.stats import norm

from graspfn.geometry import grid
from graspfn.planning.smoothing import fine_axes, hat_weights, robust_function_at, smooth, wrapped_weights


def interpolate(f: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Trilinear f (33, 44, 6) at poses q (..., 3), 0 outside, theta wrapped: the slow reference."""
    v, u, theta = np.moveaxis(grid.to_index(q), -1, 0)
    around = np.concatenate([f, f[:, :, :1]], axis=2)
    padded = np.pad(around, ((1, 1), (1, 1), (0, 0)))
    return map_coordinates(padded, [v + 1, u + 1, theta % 6], order=1, mode="constant", cval=0.0)


def random_function(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).random(grid.SHAPE)


@pytest.mark.parametrize(
    ("q", "sigma_uv", "sigma_theta"),
    [
        ([0.013, -0.041, 0.3], 0.006, np.radians(5)),
        ([-0.2131, 0.158, 3.1], 0.020, np.radians(40)),  # at an edge of Q and of theta
        ([0.1, 0.0772, 1.0], 0.0, np.radians(15)),
        ([0.1, 0.0772, 1.0], 0.015, 0.0),
    ],
)
def test_expected_score_agrees_with_monte_carlo(q, sigma_uv, sigma_theta):
    f, rng = random_function(0), np.random.default_rng(1)
    reached = np.array(q) + rng.normal(size=(200_000, 3)) * [sigma_uv, sigma_uv, sigma_theta]
    scores = interpolate(f, reached)
    exact = robust_function_at(f, (sigma_uv, sigma_theta), [q[1]], [q[0]], [q[2]]).item()
    assert abs(scores.mean() - exact) < 4 * scores.std() / np.sqrt(len(scores))


def test_without_uncertainty_it_is_the_function_itself_and_between_poses_its_interpolant():
    f = random_function(2)
    np.testing.assert_allclose(smooth(f, (0.0, 0.0)), f, atol=1e-12)
    np.testing.assert_allclose(smooth(f, (1e-9, 1e-9)), f, atol=1e-6)
    v, u, theta = fine_axes(2, 3)
    q = np.stack(np.meshgrid(v, u, theta, indexing="ij"), axis=-1)[..., [1, 0, 2]]
    np.testing.assert_allclose(robust_function_at(f, (0.0, 0.0), v, u, theta), interpolate(f, q), atol=1e-9)


@pytest.mark.parametrize("sigma", [0.0, 1e-6, 0.3, 2.0, 50.0])
def test_weights_are_a_distribution_over_the_vertices(sigma):
    """An endless line of vertices shares out a weight of 1, with the mean at the position and a hat's extra spread."""
    at, k = 0.37, np.arange(-600, 601)
    w = hat_weights(at - k, sigma)
    assert np.all(w >= 0)
    assert w.sum() == pytest.approx(1, abs=1e-9)
    assert (w * k).sum() == pytest.approx(at, abs=1e-6)


@pytest.mark.parametrize("offset", [-9.0, 9.0, 3.5, 0.5])
def test_the_weights_of_far_vertices_are_exact_too(offset):
    """By quadrature; there they are differences of nearly equal numbers."""
    slow, _ = quad(lambda x: (1 - abs(x)) * norm.pdf(x - offset), -1, 1, points=[0], epsabs=0, epsrel=1e-10)
    assert hat_weights(np.array(offset), 1.0) == pytest.approx(slow, rel=1e-8, abs=0)


@pytest.mark.parametrize("sigma_deg", [0, 5, 40, 200, 1e7])
def test_a_function_constant_in_theta_stays_so(sigma_deg):
    f = np.repeat(random_function(3)[:, :, :1], 6, axis=2)
    np.testing.assert_allclose(smooth(f, (0.0, np.radians(sigma_deg))), f, atol=1e-9)


def test_mass_is_conserved_in_the_interior():
    f = np.zeros(grid.SHAPE)
    f[14:19, 20:24] = np.random.default_rng(4).random((5, 4, 6))
    assert smooth(f, (0.015, 0.5)).sum() == pytest.approx(f.sum(), rel=1e-9)


def test_a_constant_function_loses_score_only_towards_the_edges():
    robust = smooth(np.ones(grid.SHAPE), (0.020, 0.3))
    np.testing.assert_allclose(robust[14:19, 14:30], 1, atol=1e-9)
    assert np.all(np.diff(robust[:17, 22, 0]) > -1e-12)
    assert robust[0, 0, 0] < 0.5


def test_large_uncertainty_in_theta_leaves_the_mean_over_theta():
    f = random_function(5)
    mean = np.repeat(f.mean(axis=2, keepdims=True), 6, axis=2)
    np.testing.assert_allclose(smooth(f, (0.0, np.radians(300))), mean, atol=1e-9)


def test_smoothing_commutes_with_the_symmetries_of_the_grid():
    f, sigmas = random_function(6), (0.012, 0.4)
    for move in (lambda g: g[::-1], lambda g: g[:, ::-1], lambda g: np.roll(g, 2, axis=2)):
        np.testing.assert_allclose(smooth(move(f), sigmas), move(smooth(f, sigmas)), atol=1e-12)


def test_wrapped_weights_agree_with_a_sum_over_many_turns():
    at, sigma = np.array([0.0, 0.4, 5.9, 6.4]), 3.0
    turns = np.arange(-50, 51) * 6
    slow = hat_weights(at[:, None, None] - np.arange(6)[:, None] + turns, sigma).sum(axis=2)
    np.testing.assert_allclose(wrapped_weights(at, 6, sigma), slow, atol=1e-12)


def test_the_fine_grid_holds_every_pose_of_q_and_stays_within_its_extents():
    for fine, coarse, step in zip(fine_axes(5, 3), grid.axes(), (5, 5, 3), strict=True):
        np.testing.assert_allclose(fine[::step], coarse, atol=1e-12)
        assert fine.min() >= coarse.min() - 1e-12
    assert fine_axes(5, 3)[1].max() == pytest.approx(0.215)
