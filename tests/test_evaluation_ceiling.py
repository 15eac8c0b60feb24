"""What planning by the labels is expected to bring, against a field of successes that is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from graspfn.evaluation.bench import Scene
from graspfn.evaluation.ceiling import ceilings
from graspfn.evaluation.expected import Attempts, Expected, expected_success
from graspfn.evaluation.planner import NOTHING, TRUE, Planned, Planner, true_function
from graspfn.geometry import grid
from graspfn.params import Plan
from graspfn.planning.methods import BEST, ROBUST
from graspfn.planning.uncertainty import PoseUncertainty

SCENE = Scene("made", NOTHING, np.array([0.03, -0.02]), 0.6)
PLANNER = Planner(Plan(1, 1), 0)
SIGMA = PoseUncertainty.of(5.0, 10.0)
UV = 0.005  # of SIGMA, m
CENTRE, WIDTH, TOP = np.array([0.02, -0.03]), 0.05, 0.6


def bump(q: np.ndarray, sigma: float = 0.0) -> np.ndarray:
    """Chance (...) to hold at poses (..., 3), for errors of sigma [m]: a Gaussian, the same at all angles."""
    spread = WIDTH**2 + sigma**2
    return TOP * WIDTH**2 / spread * np.exp(-0.5 * ((q[..., :2] - CENTRE) ** 2).sum(axis=-1) / spread)


def made(seed: int, count: int = 5) -> Attempts:
    rng = np.random.default_rng(seed)
    q = grid.sample_cells(count, rng)
    return Attempts(q, rng.random(q.shape[:-1]) < bump(q))


def planned(attempts: Attempts) -> dict[str, Planned]:
    (plans,) = PLANNER.plans(SCENE, [true_function(attempts)], [SIGMA])
    return {one.method: one for one in plans if one.network == TRUE}


def test_the_ceiling_is_what_plans_are_worth_where_their_own_attempts_flatter_them():
    """Of many poses that are almost as good, attempts choose those that they hold by luck."""
    true: dict[str, list[float]] = {BEST: [], ROBUST: []}
    crossed: dict[str, list[Expected]] = {BEST: [], ROBUST: []}
    flattered: dict[str, list[float]] = {BEST: [], ROBUST: []}
    for seed in range(60):
        attempts = made(seed)
        (found,) = ceilings(SCENE, PLANNER, [SIGMA], attempts)
        without = [planned(attempts.only(np.arange(5) != out)) for out in range(5)]
        for method, plan in planned(attempts).items():
            crossed[method].append(found[method])
            true[method].append(np.mean([bump(SCENE.unmoved(fold[method].q), UV) for fold in without]))
            q = SCENE.unmoved(plan.q)
            flattered[method].append(expected_success(q, UV, np.radians(10), attempts).value - bump(q, UV))
    for method in (BEST, ROBUST):
        gap = np.array([one.value for one in crossed[method]]) - true[method]
        error = gap.std(ddof=1) / np.sqrt(len(gap))
        assert abs(gap.mean()) < 3 * error + 0.003 and np.mean(flattered[method]) > max(0.03, 6 * error)
        # As of independent attempts, which they are not: each helps to choose what the others judge.
        assert 0.6 < np.mean([one.error**2 for one in crossed[method]]) ** 0.5 / gap.std(ddof=1) < 1.2


def test_where_all_poses_hold_or_none_that_is_certain():
    q = grid.sample_cells(5, np.random.default_rng(0))
    everything, nothing = (Attempts(q, np.full(q.shape[:-1], value)) for value in (True, False))
    (found,) = ceilings(Scene("made", NOTHING, np.zeros(2), 0.0), PLANNER, [SIGMA], everything)
    assert found[ROBUST].value == pytest.approx(1, abs=1e-6) and found[ROBUST].error == pytest.approx(0, abs=1e-9)
    assert ceilings(SCENE, PLANNER, [SIGMA], nothing)[0][ROBUST] == Expected(0.0, 0.0, float(nothing.held.size))
    # One lucky attempt in all: planned with it nothing else holds, planned without it there is no pose.
    once = nothing.held.copy()
    once[10, 20, 3, 2] = True
    assert ceilings(SCENE, PLANNER, [SIGMA], Attempts(q, once))[0][BEST].value == 0


def test_many_attempts_judge_in_five_parts_and_one_alone_judges_nothing():
    fold = np.arange(7) % 5
    attempts = made(1, 7)
    poses = np.stack([SCENE.unmoved(planned(attempts.only(fold != out))[ROBUST].q) for out in range(5)])
    (found,) = ceilings(SCENE, PLANNER, [SIGMA], attempts)
    assert found[ROBUST] == expected_success(poses[fold], UV, np.radians(10), attempts)
    assert ceilings(SCENE, PLANNER, [SIGMA], made(1, 1)) == [{}]
    (found,) = ceilings(SCENE, PLANNER, [PoseUncertainty.of(0.0, 10.0)], attempts)
    assert np.isnan(found[ROBUST].value)  # no density


def test_judged_pose_by_pose_the_mean_is_that_of_the_poses():
    """The same pose for every attempt is that pose; two poses with half the attempts each, their mean."""
    attempts = made(2, 40)
    one, other = np.array([0.02, -0.03, 0.4]), np.array([-0.03, 0.03, 1.2])
    alone = [expected_success(q, 0.01, 0.3, attempts) for q in (one, other)]
    assert expected_success(np.tile(one, (40, 1)), 0.01, 0.3, attempts) == alone[0]
    both = expected_success(np.stack([one, other] * 20), 0.01, 0.3, attempts)
    assert both.value == pytest.approx(np.mean([a.value for a in alone]), abs=0.02)
    edge = np.array([grid.SHAPE[1] * grid.CELL_M / 2, 0.0, 0.0])
    q = grid.sample_cells(2, np.random.default_rng(0))
    held = Attempts(q, np.ones(q.shape[:-1], dtype=bool))
    assert expected_success(np.stack([edge, one]), 0.01, 0.3, held).value == pytest.approx(0.75, abs=1e-6)
