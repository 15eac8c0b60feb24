"""Intervals that resample objects and networks: closed forms, and how often they hold the truth."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from graspfn.evaluation.statistics import Z95, resampled, resampled_rate, wilson


def test_of_one_network_the_interval_is_students() -> None:
    values = np.random.default_rng(1).normal(0.3, 0.2, (40, 1))
    found = resampled(values)
    half = stats.t.ppf(0.975, 39) * values.std(ddof=1) / np.sqrt(40)
    assert found.value == pytest.approx(values.mean())
    assert found.high - found.value == pytest.approx(half, rel=0.04) and found.value - found.low == pytest.approx(
        half, rel=0.04
    )


def test_networks_that_differ_widen_the_interval_and_copies_of_one_do_not() -> None:
    rng = np.random.default_rng(2)
    objects = rng.normal(0, 0.1, (60, 1))
    one, copies = resampled(objects), resampled(np.repeat(objects, 3, axis=1))
    apart = resampled(objects + np.array([[-0.2, 0.0, 0.2]]))
    assert copies.high - copies.low == pytest.approx(one.high - one.low, rel=0.03)
    assert apart.high - apart.low > 3 * (one.high - one.low)


def simulated(rng: np.random.Generator, objects: int, trials: int, networks: int) -> tuple[np.ndarray, float]:
    """Rates of objects of unequal difficulty under networks of unequal skill, and the mean rate of all such."""
    p = stats.norm.cdf(rng.normal(0.5, 1.0, (objects, 1)) + rng.normal(0, 0.3, (1, networks)))
    return rng.binomial(trials, p) / trials, float(stats.norm.cdf(0.5 / np.sqrt(1 + 1.0 + 0.09)))


@pytest.mark.parametrize(("objects", "trials"), [(25, 4), (60, 1), (60, 5)])
def test_intervals_hold_the_truth_nineteen_times_in_twenty(objects: int, trials: int) -> None:
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(400):
        p = stats.norm.cdf(0.5 / np.sqrt(2.0))
        values = rng.binomial(trials, stats.norm.cdf(rng.normal(0.5, 1.0, (objects, 1)))) / trials
        found = resampled_rate(values)
        hits += found.low <= p <= found.high
    assert 0.92 <= hits / 400 <= 0.985


def test_several_networks_make_the_interval_one_of_their_kind() -> None:
    rng = np.random.default_rng(4)
    hits = sum(
        found.low <= truth <= found.high
        for values, truth in (simulated(rng, 40, 4, 5) for _ in range(300))
        for found in [resampled(values)]
    )
    assert hits / 300 >= 0.87  # five networks say little of their own spread


def test_rates_stay_between_none_and_all_and_are_never_certain() -> None:
    for rate in (0.0, 1.0):
        found = resampled_rate(np.full((12, 1), rate))
        assert (found.low, found.high) == pytest.approx(wilson(rate, 12.0))
    near = resampled_rate(np.array([[1.0]] * 39 + [[0.9]]))
    assert 0.9 < near.low < near.value < near.high <= 1
    assert resampled_rate(np.array([[0.5]])).low < 0.2
    assert pytest.approx(1.96, abs=0.001) == Z95
