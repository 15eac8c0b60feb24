"""Intervals of success rates: closed form, limits, and coverage by Monte Carlo."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from graspfn.evaluation.statistics import effective_size, paired_difference, proportion


def outcomes(successes: int, trials: int) -> np.ndarray:
    return np.arange(trials) < successes


@pytest.mark.parametrize(("successes", "trials"), [(0, 10), (10, 10), (7, 10), (803, 1000), (1, 1)])
def test_independent_trials_give_wilsons_interval(successes, trials):
    ours = proportion(outcomes(successes, trials))
    theirs = stats.binomtest(successes, trials).proportion_ci(method="wilson")
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), abs=1e-12)
    assert (ours.value, ours.trials, ours.clusters) == (successes / trials, trials, trials)


def test_more_successes_move_the_interval_up_and_more_trials_narrow_it():
    rows = [proportion(outcomes(k, 30)) for k in range(31)]
    assert np.all(np.diff([row.low for row in rows]) > 0)
    assert np.all(np.diff([row.high for row in rows]) > 0)
    widths = [row.high - row.low for row in (proportion(outcomes(3 * n, 5 * n)) for n in (1, 5, 25, 125))]
    assert np.all(np.diff(widths) < 0)


def test_objects_of_one_trial_each_are_independent_trials():
    success = outcomes(12, 20)
    assert proportion(success, np.arange(20)) == proportion(success)


def few_clusters(k: int) -> float:
    """What the spread between k clusters says less than a known one would: (z / t)^2."""
    return float((stats.norm.ppf(0.975) / stats.t.ppf(0.975, k - 1)) ** 2)


@pytest.mark.parametrize(("objects", "repeats"), [(40, 5), (4, 2), (2, 50)])
def test_repeats_that_always_agree_hold_no_more_than_their_objects(objects, repeats):
    """In closed form: the rate's variance is the objects' sample variance over their number."""
    agreeing = np.repeat(outcomes(objects // 2, objects), repeats)
    size = effective_size(agreeing.astype(float), np.repeat(np.arange(objects), repeats))
    assert size == pytest.approx((objects - 1) * few_clusters(objects))


def test_repeats_that_never_agree_count_as_independent_trials_and_not_more():
    """The rates of such objects differ less than chance would have them: by nothing, and then by little."""
    success, objects = np.tile([True, False], 30), np.repeat(np.arange(15), 4)
    assert effective_size(success.astype(float), objects) == pytest.approx(60 * few_clusters(15))
    success[0] = False  # one object of 1 in 4 among those of 2 in 4
    assert effective_size(success.astype(float), objects) == pytest.approx(60 * few_clusters(15))


def test_names_of_objects_and_the_order_of_trials_do_not_matter():
    rng = np.random.default_rng(4)
    success, objects = rng.random(60) < 0.6, rng.integers(0, 9, 60)
    shuffled = rng.permutation(60)
    names = np.array([f"object-{9 - i}" for i in objects])
    one, other = proportion(success, objects), proportion(success[shuffled], names[shuffled])
    assert (one.value, one.low, one.high) == pytest.approx((other.value, other.low, other.high))
    assert (one.trials, one.clusters) == (other.trials, other.clusters) == (60, 9)


@pytest.mark.parametrize("successes", [0, 60])
def test_without_any_variance_only_objects_count(successes):
    alike = proportion(outcomes(successes, 60), np.repeat(np.arange(12), 5))
    single = proportion(outcomes(min(successes, 12), 12))
    assert (alike.low, alike.high) == (single.low, single.high)
    assert (alike.trials, alike.clusters) == (60, 12)


def test_many_trials_of_one_object_say_as_little_as_one():
    alone = proportion(outcomes(8, 10), np.zeros(10))
    assert alone.high - alone.low > 0.7


def test_coverage_of_independent_trials():
    rng = np.random.default_rng(0)
    rows = [proportion(rng.random(60) < 0.75) for _ in range(3000)]
    covered = np.mean([row.low <= 0.75 <= row.high for row in rows])
    assert 0.93 < covered < 0.97


def test_coverage_of_trials_that_share_objects():
    """Beta-binomial objects, correlation 1/3 between trials of one: clustered intervals cover, plain ones do not."""
    rng = np.random.default_rng(1)
    objects = np.repeat(np.arange(20), 5)
    rows, plain = [], []
    for _ in range(1500):
        success = rng.random(100) < rng.beta(1.4, 0.6, 20)[objects]
        rows.append(proportion(success, objects))
        plain.append(proportion(success))
    assert 0.93 < np.mean([row.low <= 0.7 <= row.high for row in rows]) < 0.98
    assert np.mean([row.low <= 0.7 <= row.high for row in plain]) < 0.88


def test_coverage_of_paired_differences():
    rng = np.random.default_rng(2)
    objects = np.repeat(np.arange(20), 5)
    rows = []
    for _ in range(1500):
        ease = rng.beta(2, 2, 20)[objects]
        gain = rng.uniform(-0.2, 0.6, 20)[objects]  # of 0.2 on average, but not on every object
        draw = rng.random(100)
        rows.append(paired_difference(draw < 0.2 + 0.2 * ease + gain, draw < 0.2 + 0.2 * ease, objects))
    truth = 0.2
    assert abs(np.mean([row.value for row in rows]) - truth) < 0.01
    assert 0.92 < np.mean([row.low <= truth <= row.high for row in rows]) < 0.985


def test_coverage_with_few_objects_of_unequal_numbers_of_trials():
    rng = np.random.default_rng(5)
    objects = np.repeat(np.arange(6), [2, 4, 6, 8, 10, 12])
    rows = [proportion(rng.random(42) < rng.beta(2, 2, 6)[objects], objects) for _ in range(1500)]
    assert 0.93 < np.mean([row.low <= 0.5 <= row.high for row in rows]) < 0.985


@pytest.mark.parametrize(("wins", "losses", "pairs"), [(7, 2, 30), (0, 0, 10), (3, 0, 3), (0, 3, 3), (1, 1, 2)])
def test_independent_pairs_give_agresti_and_mins_interval(wins, losses, pairs):
    """Wald's interval of matched pairs, b and c of n discordant, with half a pair added to each cell of the table."""
    ours = paired_difference(np.arange(pairs) < wins, np.arange(pairs) >= pairs - losses)
    b, c, n = wins + 0.5, losses + 0.5, pairs + 2
    half = stats.norm.ppf(0.975) * np.sqrt(b + c - (b - c) ** 2 / n) / n
    expected = max(-1.0, (b - c) / n - half), min(1.0, (b - c) / n + half)
    assert (ours.low, ours.high) == pytest.approx(expected, abs=1e-12)
    assert (ours.value, ours.pairs, ours.clusters) == (pytest.approx((wins - losses) / pairs), pairs, pairs)


def test_swapping_the_methods_swaps_the_difference():
    rng = np.random.default_rng(3)
    a, b, objects = rng.random(50) < 0.8, rng.random(50) < 0.6, np.repeat(np.arange(10), 5)
    one, other = paired_difference(a, b, objects), paired_difference(b, a, objects)
    assert (one.value, one.low, one.high) == pytest.approx((-other.value, -other.high, -other.low))


def test_methods_that_always_agree_are_not_certainly_equal():
    few = paired_difference(np.ones(10), np.ones(10))
    many = paired_difference(np.ones(1000), np.ones(1000))
    assert few.value == many.value == 0
    assert few.low < -0.05 < 0.05 < few.high
    assert many.high < 0.005


def test_pairing_narrows_the_interval():
    """The same two rates: one method wins wherever they differ, or they differ everywhere they can."""
    a = outcomes(80, 100)
    nested = paired_difference(a, outcomes(70, 100))
    opposed = paired_difference(a, outcomes(70, 100)[::-1])
    assert nested.value == opposed.value == pytest.approx(0.1)
    assert nested.high - nested.low < 0.6 * (opposed.high - opposed.low)
    assert nested.low > 0 > opposed.low
