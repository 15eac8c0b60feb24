"""Where Best Grasp and Robust Best Grasp send the gripper."""

from __future__ import annotations

import numpy as np
import pytest

from graspfn.geometry import grid
from graspfn.params import Plan
from graspfn.planning.methods import best_grasp, robust_best_grasp
from graspfn.planning.robust import RobustFunction
from graspfn.planning.smoothing import robust_function_at, smooth
from graspfn.planning.uncertainty import PlanningError, PoseUncertainty

PLAN = Plan(fine_uv=5, fine_theta=6)


def robust(f: np.ndarray, sigmas: tuple[float, float], plan: Plan, rng: np.random.Generator) -> np.ndarray | None:
    return robust_best_grasp(RobustFunction(f, PoseUncertainty(sigmas)), plan, rng)


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
    sides = [np.sign(robust(f, (0.01, 0.3), Plan(5, 1), rng)[0]) for _ in range(20)]
    assert set(sides) == {-1.0, 1.0}


def test_uncertainty_repels_the_pose_from_a_lone_peak_to_a_plateau():
    f = np.zeros(grid.SHAPE)
    f[5, 5, 0] = 1.0
    f[20:27, 25:32, :] = 0.8
    rng = np.random.default_rng(5)
    np.testing.assert_allclose(robust(f, (1e-4, 1e-3), PLAN, rng), grid.from_index([5, 5, 0]), atol=2e-3)
    q = robust(f, (0.015, np.radians(20)), PLAN, rng)
    np.testing.assert_allclose(q[:2], grid.from_index([23, 28, 0])[:2], atol=1e-9)


@pytest.mark.parametrize(
    ("cells", "middle", "fine", "coarse"),
    [
        ([(20, 9, 2), (20, 10, 2)], (20, 9.5, 2), Plan(2, 1), Plan(1, 2)),
        ([(20, 9, 2), (21, 9, 2)], (20.5, 9, 2), Plan(2, 1), Plan(1, 2)),
        ([(20, 9, 5), (20, 9, 0)], (20, 9, 5.5), Plan(1, 2), Plan(2, 1)),  # theta wraps
        ([(20, 9, 0), (20, 10, 0), (21, 9, 0), (21, 10, 0)], (20.5, 9.5, 0), Plan(4, 3), Plan(3, 4)),
    ],
    ids=["u", "v", "theta", "both"],
)
def test_of_neighbours_as_good_as_each_other_refinement_finds_the_middle(cells, middle, fine, coarse):
    """Off the middle, errors fall off the farther one sooner; where no pose is tried there, a parabola comes near."""
    f, sigma = np.zeros(grid.SHAPE), (0.008, np.radians(24))  # 0.8 of a cell each
    f[tuple(np.transpose(cells))] = 1.0
    index = grid.to_index(robust(f, sigma, fine, np.random.default_rng(0)))
    np.testing.assert_allclose(index, middle, atol=1e-9)
    index = grid.to_index(robust(f, sigma, coarse, np.random.default_rng(0)))
    assert abs(index - middle).max() < 0.1
    highest = RobustFunction(f, PoseUncertainty(sigma)).highest(coarse)
    off = abs(grid.to_index(highest.poses[-1]) - middle)
    assert 0.1 < off.max() < 0.6


def test_no_pose_nearby_has_a_higher_expected_score():
    """A search a cell around it finds none better by more than the fine grid's steps can cost."""
    sigma = 0.006, 0.1
    for seed in range(5):
        f = np.random.default_rng(seed).random(grid.SHAPE)
        u, v, theta = robust(f, sigma, PLAN, np.random.default_rng(0))
        step = np.linspace(-1, 1, 9)
        around = robust_function_at(
            f, sigma, v + step * grid.CELL_M, u + step * grid.CELL_M, theta + step * grid.CELL_RAD
        )
        assert around.max() <= around[4, 4, 4] + 0.002


def test_the_pose_stays_within_q():
    f = np.zeros(grid.SHAPE)
    f[0, -1, 5] = 1.0
    u, v, theta = robust(f, (0.02, 0.5), PLAN, np.random.default_rng(0))
    assert (u, v) == pytest.approx((0.215, -0.16))
    assert theta == pytest.approx(5 * grid.CELL_RAD)


@pytest.mark.parametrize("f", [np.zeros(grid.SHAPE), np.zeros(grid.SHAPE, np.uint8), np.full(grid.SHAPE, -0.1)])
def test_without_a_score_above_zero_there_is_no_grasp(f):
    rng = np.random.default_rng(0)
    assert best_grasp(f, rng) is None
    assert robust(f, (0.01, 0.3), PLAN, rng) is None


def test_a_robust_function_of_zeros_is_no_grasp():
    """The only score is so small, and spread so far, that nothing is left of it."""
    f = np.zeros(grid.SHAPE)
    f[16, 20, 3] = 5e-324
    assert best_grasp(f, np.random.default_rng(0)) is not None
    assert robust(f, (0.1, 0.3), PLAN, np.random.default_rng(0)) is None


@pytest.mark.parametrize("scale", [1e-3, 1e-9, 1e-14, 1e-30, 1e3])
def test_the_pose_does_not_depend_on_the_scale_of_the_scores(scale):
    """Scores of a softmax are never 0; however small they all are, the highest is the highest."""
    f = np.random.default_rng(6).random(grid.SHAPE)
    for plan in (best_grasp, lambda f, rng: robust(f, (0.01, 0.3), PLAN, rng)):
        poses = [plan(g, np.random.default_rng(seed)) for g in (f, scale * f) for seed in (0, 1)]
        np.testing.assert_allclose(poses, [poses[0]] * 4, atol=1e-12)


def test_a_small_constant_function_is_still_planned_on():
    f = np.full(grid.SHAPE, 1e-6, np.float32)
    q = robust(f, (0.01, 0.3), PLAN, np.random.default_rng(0))
    assert np.hypot(*q[:2]) < 0.2 and best_grasp(f, np.random.default_rng(0)) is not None


@pytest.mark.parametrize("bad", [-1e-9, -0.01, np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("which", ["sigma_uv", "sigma_theta"])
def test_what_is_no_standard_deviation_is_refused_by_name(bad, which):
    f = np.random.default_rng(0).random(grid.SHAPE)
    sigmas = (bad, 0.3) if which == "sigma_uv" else (0.01, bad)
    for plan in (lambda: PoseUncertainty(sigmas), lambda: smooth(f, sigmas)):
        with pytest.raises(PlanningError, match=rf"^{which}: is .*; it takes a finite number of at least 0$"):
            plan()


@pytest.mark.parametrize(
    ("f", "says"),
    [
        (np.where(np.arange(8712).reshape(grid.SHAPE) % 1000, 0.5, np.nan), "9 of its 8712 scores are NaN or infinite"),
        (np.full(grid.SHAPE, np.inf), "8712 of its 8712 scores"),
        (np.ones((6, 33, 44)), r"shape \(6, 33, 44\); it takes numbers of shape \(33, 44, 6\)"),
        (np.ones((1, *grid.SHAPE)), "of shape"),
        (np.ones(0), "of shape"),
        (np.ones(grid.SHAPE, complex), "is complex128"),
        (np.full(grid.SHAPE, "1"), "is <U1"),
    ],
)
def test_what_is_no_grasp_function_is_refused_by_name(f, says):
    rng = np.random.default_rng(0)
    for plan in (lambda: best_grasp(f, rng), lambda: robust(f, (0.01, 0.3), PLAN, rng)):
        with pytest.raises(PlanningError, match=f"^grasp function: .*{says}"):
            plan()
