"""Where Best Grasp and Robust Best Grasp send the gripper."""

from __future__ import annotations

import time

import numpy as np
import pytest

from graspfn.geometry import grid
from graspfn.params import Plan
from graspfn.planning.methods import best_grasp, robust_best_grasp
from graspfn.planning.smoothing import robust_function_at

PLAN = Plan(fine_uv=5, fine_theta=6)


def test_best_grasp_is_the_highest_pose():
    f = np.random.default_rng(0).random(grid.SHAPE)
    q = best_grasp(f, np.random.default_rng(1))
    i, j, k = np.round(grid.to_index(q)).astype(int)
    assert f[i, j, k] == f.max()


def test_ties_are_broken_evenly():
    f = np.zeros(grid.SHAPE)
    f[3, 4, 5] = f[20, 30, 1] = f[20, 31, 1] = 0.8
    rng = np.random.default_rng(2)
    drawn = np.array([best_grasp(f, rng) for _ in range(450)])
    _, counts = np.unique(drawn.round(6), axis=0, return_counts=True)
    assert len(counts) == 3
    assert np.all(abs(counts - 150) < 5 * np.sqrt(450 * 2 / 9))


@pytest.mark.parametrize("seed", range(4))
def test_mirror_images_that_rounding_tells_apart_are_still_ties(seed):
    f = np.random.default_rng(seed).random(grid.SHAPE) ** 8
    f = f + f[:, ::-1]
    rng = np.random.default_rng(4)
    sides = [np.sign(robust_best_grasp(f, 0.01, 0.3, Plan(5, 1), rng)[0]) for _ in range(20)]
    assert set(sides) == {-1.0, 1.0}


def test_uncertainty_repels_the_pose_from_a_lone_peak_to_a_plateau():
    f = np.zeros(grid.SHAPE)
    f[5, 5, 0] = 1.0
    f[20:27, 25:32, :] = 0.8
    rng = np.random.default_rng(5)
    np.testing.assert_allclose(robust_best_grasp(f, 1e-4, 1e-3, PLAN, rng), grid.from_index([5, 5, 0]), atol=2e-3)
    q = robust_best_grasp(f, 0.015, np.radians(20), PLAN, rng)
    np.testing.assert_allclose(q[:2], grid.from_index([23, 28, 0])[:2], atol=1e-9)


def test_refinement_never_lowers_and_usually_raises_the_expected_score():
    raised = 0
    for seed in range(5):
        f = np.random.default_rng(seed).random(grid.SHAPE)
        scores = []
        for plan in (Plan(1, 1), PLAN):
            u, v, theta = robust_best_grasp(f, 0.006, 0.1, plan, np.random.default_rng(0))
            scores.append(robust_function_at(f, 0.006, 0.1, [v], [u], [theta]).item())
        assert scores[1] >= scores[0] - 1e-12
        raised += scores[1] > scores[0] + 1e-6
    assert raised >= 3


def test_the_pose_stays_within_q():
    f = np.zeros(grid.SHAPE)
    f[0, -1, 5] = 1.0
    u, v, theta = robust_best_grasp(f, 0.02, 0.5, PLAN, np.random.default_rng(0))
    assert (u, v) == pytest.approx((0.215, -0.16))
    assert theta == pytest.approx(5 * grid.CELL_RAD)


def test_planning_takes_a_fraction_of_a_second():
    f = np.random.default_rng(0).random(grid.SHAPE)
    rng = np.random.default_rng(0)
    best = np.inf
    for _ in range(5):
        start = time.perf_counter()
        best_grasp(f, rng)
        robust_best_grasp(f, 0.01, 0.3, PLAN, rng)
        best = min(best, time.perf_counter() - start)
    assert best < 0.5  # tens of milliseconds; the margin is for busy machines
