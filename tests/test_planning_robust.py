"""The robust grasp function under any covariance, and its maximum below the spacing of Q."""

from __future__ import annotations

import numpy as np
import pytest
from test_planning_smoothing import interpolate, random_function

from graspfn.geometry import grid
from graspfn.params import Plan
from graspfn.planning.coupled import Coupled
from graspfn.planning.methods import robust_best_grasp
from graspfn.planning.robust import RobustFunction, gain
from graspfn.planning.smoothing import fine_axes, hat_weights, robust_function_at, smooth
from graspfn.planning.uncertainty import PlanningError, PoseUncertainty

PLAN = Plan(fine_uv=5, fine_theta=6)
UNITS = np.array([grid.CELL_M, grid.CELL_M, grid.CELL_RAD])  # of u, v and theta
DRAWS = 1_000_000
EXACT = 2e-3  # agreement with a million draws, whose own error is up to 5e-4


def correlated(sigmas: tuple[float, float, float], rank: int, seed: int) -> np.ndarray:
    """A random covariance of that rank with these standard deviations of u, v and theta, in cells."""
    factor = np.random.default_rng(seed).normal(size=(3, rank))
    factor *= (np.array(sigmas) * UNITS / np.sqrt((factor**2).sum(axis=1)))[:, None]
    return factor @ factor.T


def objects(seed: int) -> np.ndarray:
    """(33, 44, 6) as grasp functions are: a few ridges and peaks about one place, 0 elsewhere."""
    rng = np.random.default_rng(seed)
    f = np.zeros(grid.SHAPE)
    v, u = rng.integers(6, 24), rng.integers(6, 34)
    f[v : v + 5, u : u + 6] = rng.random((5, 6, 6)) ** rng.choice([1, 3])
    f[v + 1 : v + 4, u + 2, rng.integers(6)] = 0.9
    return f


@pytest.mark.parametrize("rank", [1, 2, 3])
@pytest.mark.parametrize(
    "sigmas", [(0.1, 0.1, 0.1), (0.5, 0.5, 0.17), (2, 1, 1), (0.05, 6, 0.3), (0, 2, 1), (1, 1, 0), (60, 50, 6)]
)
def test_expected_score_agrees_with_monte_carlo(sigmas, rank):
    """Wide or narrow, singular, and larger than the grid."""
    f, rng = random_function(rank), np.random.default_rng(rank)
    sigma = PoseUncertainty(correlated(sigmas, rank, seed=rank))
    q = np.array([0.0831, -0.0412, 2.9])
    drawn = interpolate(f, q + rng.multivariate_normal(np.zeros(3), sigma.covariance_at(q), DRAWS, method="eigh"))
    robust = RobustFunction(f, sigma)
    assert abs(robust.at(q[None]).item() - drawn.mean()) < EXACT
    varying = RobustFunction(f, PoseUncertainty(lambda _: sigma.covariance_at(q)))
    np.testing.assert_allclose(varying.at(q[None]), robust.at(q[None]), atol=1e-9)


@pytest.mark.parametrize("sigmas", [(0.4, 0.7, 0.5), (2, 0.1, 1.5), (0, 1, 0), (1, 0, 0.3), (0, 0, 0), (20, 30, 9)])
def test_where_nothing_correlates_it_is_the_separable_one(sigmas):
    f, sigmas = random_function(1), np.array(sigmas) * UNITS
    coupled, exact = Coupled(f, np.diag(sigmas**2)), smooth(f, sigmas)
    np.testing.assert_allclose(coupled.on_q(), exact, atol=EXACT / 2)
    poses = grid.poses()[::7, ::9].reshape(-1, 3)
    np.testing.assert_allclose(coupled.at_index(grid.to_index(poses)), exact[::7, ::9].ravel(), atol=EXACT / 2)


@pytest.mark.parametrize("rank", [1, 2, 3])
def test_all_ways_of_asking_agree(rank):
    f = random_function(2)
    coupled = Coupled(f, correlated((0.7, 3, 0.8), rank, seed=5))
    q, shift = grid.poses()[::8, ::10].reshape(-1, 3), (0.2, 0.4, 1 / 3)
    np.testing.assert_allclose(coupled.at_index(grid.to_index(q)), coupled.on_q()[::8, ::10].ravel(), atol=1e-9)
    index = grid.to_index(q) + shift
    np.testing.assert_allclose(coupled.at_index(index), coupled.on_q(shift)[::8, ::10].ravel(), atol=1e-9)
    np.testing.assert_allclose([coupled.at_index(at[None]).item() for at in index], coupled.at_index(index), atol=1e-9)


def test_errors_of_angle_that_go_with_those_of_position_are_told_from_others():
    """f is a ridge that turns as it goes along v: errors along it cost little, across it they do."""
    v, _, theta = np.meshgrid(*(np.arange(n) for n in grid.SHAPE), indexing="ij")
    f = np.clip(1.5 - abs((v / 3 - theta + 3) % 6 - 3), 0, 1)
    sigma_v, sigma_theta = 3 * grid.CELL_M, 1.0 * grid.CELL_RAD
    along = np.diag([0, sigma_v**2, sigma_theta**2])
    along[1, 2] = along[2, 1] = sigma_v * sigma_theta
    across = along * np.where(np.eye(3), 1, -1)
    q = grid.poses()[18, 22, 0]
    values = [RobustFunction(f, PoseUncertainty(sigma)).at(q[None]).item() for sigma in (along, across)]
    independent = RobustFunction(f, PoseUncertainty((0, sigma_v, sigma_theta))).at(q[None]).item()
    assert values[0] > 0.9 and values[1] < 0.5 and values[1] < independent < values[0]


def test_turning_the_world_by_a_quarter_turns_the_function():
    """(u, v, theta) -> (v, -u, theta - 90 degrees), where Q's sides allow."""
    f = np.zeros(grid.SHAPE)
    f[8:25, 14:31] = np.random.default_rng(3).random((17, 17, 6))
    turned = np.zeros(grid.SHAPE)
    turned[8:25, 14:31] = np.roll(f[8:25, 14:31][:, ::-1].transpose(1, 0, 2), -3, axis=2)
    J = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]])
    sigma = correlated((1.3, 0.4, 0.6), 3, seed=2)
    one, other = Coupled(f, sigma).on_q(), Coupled(turned, J @ sigma @ J.T).on_q()
    np.testing.assert_allclose(
        other[8:25, 14:31], np.roll(one[8:25, 14:31][:, ::-1].transpose(1, 0, 2), -3, axis=2), atol=1e-3
    )


def full_fine_maximum(f: np.ndarray, sigma: PoseUncertainty) -> float:
    """Over every pose of the fine grid."""
    if sigma.sigmas is not None:
        return float(robust_function_at(f, sigma.sigmas, *fine_axes(PLAN.fine_uv, PLAN.fine_theta)).max())
    coupled, best = Coupled(f, sigma.covariance_at(np.zeros(3))), 0.0
    for i, j, k in np.ndindex(PLAN.fine_uv, PLAN.fine_uv, PLAN.fine_theta):
        values = coupled.on_q((i / PLAN.fine_uv, j / PLAN.fine_uv, k / PLAN.fine_theta))
        best = max(best, values[: 32 if i else 33, : 43 if j else 44].max())
    return best


@pytest.mark.parametrize("make", [objects, random_function])
@pytest.mark.parametrize("sigmas", [(0, 0, 0), (0.2, 0.2, 0.1), (0.5, 0.5, 0.33), (1.5, 0.3, 0), (2, 2, 1)])
def test_coarse_to_fine_finds_the_maximum_of_the_full_fine_grid(sigmas, make):
    sigma = PoseUncertainty(np.array(sigmas) * UNITS)
    for seed in range(3):
        f = make(seed)
        found = RobustFunction(f, sigma).highest(PLAN)
        assert found.value == pytest.approx(full_fine_maximum(f, sigma), rel=1e-12)
        np.testing.assert_allclose(RobustFunction(f, sigma).at(found.poses), found.value, rtol=1e-9)


@pytest.mark.parametrize("rank", [1, 2, 3])
@pytest.mark.parametrize("sigmas", [(0.1, 0.1, 0.1), (0.5, 0.5, 0.17), (0.5, 2, 1)])
def test_so_does_the_search_where_errors_correlate(sigmas, rank):
    sigma = PoseUncertainty(correlated(sigmas, rank, seed=rank))
    for seed in range(2):
        f = objects(seed)
        assert RobustFunction(f, sigma).highest(PLAN).value == pytest.approx(full_fine_maximum(f, sigma), rel=1e-9)


@pytest.mark.parametrize("sigma", [0.0, 0.1, 0.4, 1.0, 5.0, 80.0])
def test_no_value_between_vertices_exceeds_its_bound(sigma):
    at, vertices = np.linspace(0, 1, 6), np.arange(-400, 401)
    ends = np.outer(1 - at, hat_weights(vertices, sigma)) + np.outer(at, hat_weights(1 - vertices, sigma))
    inside = hat_weights(at[:, None] - vertices, sigma)
    assert (inside <= gain(sigma, 5) * ends + 1e-15).all()
    assert 1 <= gain(sigma, 5) < 1.2 and gain(0.0, 5) == 1


@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("peak", [(0.0331, -0.0472, 1.234), (-0.1015, 0.0649, 3.1), (0.002, 0.0015, 0.05)])
def test_a_peak_between_the_poses_of_q_is_found_to_a_millimetre_and_two_degrees(peak, coupled):
    v, u, theta = np.moveaxis(grid.to_index(grid.poses()) - grid.to_index(np.array(peak)), -1, 0)
    f = np.exp(-0.5 * ((v**2 + u**2) / 1.5**2 + ((theta + 3) % 6 - 3) ** 2))
    covariance = np.diag(np.array([0.4, 0.4, 0.4]) * UNITS) ** 2
    if coupled:
        covariance[0, 2] = covariance[2, 0] = 0.7 * 0.16 * UNITS[0] * UNITS[2]
    robust = RobustFunction(f, PoseUncertainty(covariance))
    q = robust.between(robust.highest(PLAN).poses[0], PLAN)
    assert np.abs(q[:2] - peak[:2]).max() < 0.001 and abs(grid.angle_difference(q[2], peak[2])) < np.radians(2)


def test_between_fine_poses_nothing_moves_on_a_plateau_or_out_of_q():
    f = np.zeros(grid.SHAPE)
    f[10:30, 10:30] = 1
    robust, q = RobustFunction(f, PoseUncertainty((0.005, 0.2))), grid.from_index(np.array([20, 20, 3]))
    np.testing.assert_array_equal(robust.between(q, PLAN), q)
    f[:, -1] = 2
    assert robust.between(grid.from_index(np.array([16, 43, 0])), PLAN)[0] <= grid.axes()[1][-1]


def test_an_arm_that_is_less_certain_farther_out_is_sent_to_the_nearer_of_two_grasps():
    f = np.zeros(grid.SHAPE)
    f[16, 12, 2], f[16, 34, 2] = 0.8, 0.9
    growing = PoseUncertainty(lambda q: np.diag([0.002 + 0.02 * (q[0] > 0), 0.002, 0.05]) ** 2)
    coarse = Plan(fine_uv=1, fine_theta=1)
    q = robust_best_grasp(RobustFunction(f, growing), coarse)
    np.testing.assert_allclose(q, grid.from_index(np.array([16, 12, 2])), atol=1e-9)
    np.testing.assert_allclose(
        robust_best_grasp(RobustFunction(f, PoseUncertainty((0.002, 0.05))), coarse),
        grid.from_index(np.array([16, 34, 2])),
        atol=1e-9,
    )


def test_of_equals_the_first_in_the_order_of_v_u_and_theta():
    f = np.zeros(grid.SHAPE)
    f[20, 5, 3] = f[10, 30, 4] = f[10, 31, 1] = f[20, 5, 0] = 0.5
    for sigma in (PoseUncertainty((0.0, 0.0)), PoseUncertainty((0.001, 0.01))):
        np.testing.assert_allclose(
            robust_best_grasp(RobustFunction(f, sigma), PLAN), grid.from_index(np.array([10, 30, 4]))
        )


@pytest.mark.parametrize("sigma", [(0.01, 0.3), correlated((1, 1, 1), 3, 0)])
def test_nothing_above_zero_is_no_grasp_and_no_function_is_refused(sigma):
    sigma = PoseUncertainty(sigma)
    for f in (np.zeros(grid.SHAPE), np.full(grid.SHAPE, -0.1)):
        assert robust_best_grasp(RobustFunction(f, sigma), PLAN) is None
    with pytest.raises(PlanningError, match=r"^grasp function"):
        RobustFunction(np.full(grid.SHAPE, np.nan), sigma)


@pytest.mark.parametrize("rank", [1, 2, 3])
def test_few_poses_and_many_have_the_same_values(rank):
    """Within Q, at its edges and past a turn of theta; one way sums at the vertices, the other at the errors."""
    rng = np.random.default_rng(rank)
    factor = rng.normal(size=(3, rank)) * [[0.01], [0.02], [0.5]]
    coupled = Coupled(random_function(rng), factor @ factor.T)
    index = rng.uniform([-2, -2, -7], [35, 46, 13], size=(40, 3))
    index[:3] = [0, 0, 0], [32, 43, 5], [16, 20, -1e-20]
    np.testing.assert_allclose(coupled.at_index(index), coupled.at_few(index), atol=1e-12)
