"""Pose uncertainties: what is one, what is none, and that errors drawn with one have it."""

from __future__ import annotations

import numpy as np
import pytest

from graspfn.geometry.grid import angle_difference
from graspfn.planning.uncertainty import PlanningError, PoseUncertainty

SIGMAS = np.array([0.01, 0.02, 0.3])
CORRELATED = np.array([[1, 0.5, -0.8], [0.5, 1, 0], [-0.8, 0, 1]]) * np.outer(SIGMAS, SIGMAS)
Q = np.array([0.1, -0.05, 3.0])


def test_two_and_three_standard_deviations_are_diagonals():
    np.testing.assert_allclose(PoseUncertainty((0.01, 0.3)).covariance_at(Q), np.diag([0.01, 0.01, 0.3]) ** 2)
    np.testing.assert_allclose(PoseUncertainty(SIGMAS).covariance_at(Q), np.diag(SIGMAS**2))
    np.testing.assert_allclose(PoseUncertainty.of(10, 90).sigmas, [0.01, 0.01, np.pi / 2])
    np.testing.assert_allclose(PoseUncertainty(np.diag(SIGMAS**2)).sigmas, SIGMAS)
    assert PoseUncertainty(CORRELATED).sigmas is None


@pytest.mark.parametrize("rank", [1, 2, 3])
def test_errors_have_the_covariance_that_they_are_drawn_with(rank):
    factor = np.random.default_rng(rank).normal(size=(3, rank)) * [[0.01], [0.02], [0.1]]
    sigma = PoseUncertainty(factor @ factor.T)
    reached = sigma.reached(Q, np.random.default_rng(0).standard_normal((40_000, 3)))
    missed = np.column_stack([reached[:, :2] - Q[:2], angle_difference(reached[:, 2], Q[2])])
    assert np.all((reached[:, 2] >= 0) & (reached[:, 2] < np.pi))
    sd = np.sqrt(np.diag(factor @ factor.T))
    np.testing.assert_allclose(np.cov(missed.T) / np.outer(sd, sd), factor @ factor.T / np.outer(sd, sd), atol=0.03)


def test_a_function_of_the_pose_is_asked_at_the_pose_and_cannot_change_it():
    def farther_is_worse(q):
        sigma = 0.1 * np.hypot(*q[:2])
        q[:] = np.nan
        return np.diag([sigma, sigma, 0.1]) ** 2

    sigma, q = PoseUncertainty(farther_is_worse), Q.copy()
    assert sigma.varies and sigma.sigmas is None
    np.testing.assert_allclose(sigma.covariance_at(q)[0, 0], 0.01 * (0.1**2 + 0.05**2))
    np.testing.assert_array_equal(q, Q)


def indefinite():
    matrix = CORRELATED.copy()
    matrix[0, 1] = matrix[1, 0] = 0.9 * SIGMAS[0] * SIGMAS[1]
    matrix[1, 2] = matrix[2, 1] = 0.5 * SIGMAS[1] * SIGMAS[2]
    return matrix


def changed(i, j, value):
    matrix = CORRELATED.copy()
    matrix[i, j] = value
    return matrix


@pytest.mark.parametrize(
    ("sigma", "says"),
    [
        ((-0.01, 0.1), "sigma_uv: is -0.01 m; it takes a finite number of at least 0"),
        ((0.01, np.nan), "sigma_theta: is nan rad"),
        ((0.01, -1e-9, 0.1), "sigma_v: is -1e-09 m"),
        ((np.inf, 0.01, 0.1), "sigma_u: is inf m"),
        (changed(1, 1, -1e-6), r"covariance: the variance of v is -1e-06 m\^2; it takes at least 0"),
        (changed(0, 2, np.nan), "covariance: 1 of its 9 numbers are NaN or infinite"),
        (changed(0, 2, 0.0), "covariance: not symmetric"),
        (indefinite(), "covariance: not positive semi-definite"),
        (np.array([[0, 1e-6, 0], [1e-6, 1, 0], [0, 0, 1]]), "covariance: not positive semi-definite"),
        (np.eye(2), r"covariance: has the shape \(2, 2\); it takes \(3, 3\)"),
        (0.01, r"covariance: has the shape \(\)"),
        ([[1, 2], [3]], "covariance: takes 3 x 3 numbers"),
        ("wide", "covariance: takes 3 x 3 numbers"),
    ],
)
def test_what_is_no_uncertainty_is_refused_by_name(sigma, says):
    with pytest.raises(PlanningError, match=f"^{says}") as caught:
        PoseUncertainty(sigma)
    assert "\n" not in str(caught.value)
    if np.ndim(np.array(sigma, dtype=object)) == 2:  # also where a function of the pose gives it, with the pose
        with pytest.raises(PlanningError, match=r"^covariance at \(0.100 m, -0.050 m, 3.000 rad\): "):
            PoseUncertainty(lambda q: sigma).covariance_at(Q)


@pytest.mark.parametrize("scale", [1e-12, 1e-3, 1e6])
@pytest.mark.parametrize("rank", [1, 2])
def test_singular_covariances_are_taken_whatever_their_size(rank, scale):
    """Rounding leaves them eigenvalues a little below 0."""
    for seed in range(20):
        factor = np.random.default_rng(seed).normal(size=(3, rank)) * np.array([[1], [scale], [1]])
        PoseUncertainty(factor @ factor.T * scale)
    PoseUncertainty(np.zeros((3, 3)))
