"""How sure a success rate is: 95% intervals of proportions and of differences between methods.

Trials that share an object are not independent: an object that is hard once is hard again. n trials then hold the
information of fewer, n / deff, where the design effect deff is the variance of the rate between objects over the
binomial p (1 - p) / n (Kish). The interval is the one for independent trials at that effective sample size
(Korn and Graubard), never at a larger one: deff below 1 is taken as chance.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from scipy import stats

Z95 = float(stats.norm.ppf(0.975))


@dataclass(frozen=True)
class Proportion:
    """A success rate with its 95% interval; `clusters` is the number of objects behind the `trials`."""

    value: float
    low: float
    high: float
    trials: int
    clusters: int


@dataclass(frozen=True)
class Difference:
    """Success rate of one method less that of another on the same trials, with its 95% interval."""

    value: float
    low: float
    high: float
    pairs: int
    clusters: int


def effective_size(values: np.ndarray, clusters: np.ndarray) -> float:
    """Independent trials that hold as much information on the mean as values (n,) in clusters (n,) do.

    Few clusters say little about the variance between them, so the size also shrinks by (z / t)^2, t the quantile
    for one degree of freedom less than there are clusters. Where the values have no variance at all, nothing shows
    that trials of one cluster are independent: the size is the number of clusters.
    """
    n = len(values)
    _, index, sizes = np.unique(clusters, return_inverse=True, return_counts=True)
    k = len(sizes)
    if k == n:  # one trial each: nothing is clustered
        return float(n)
    binomial = values.var() / n
    if k == 1 or binomial == 0:
        return float(k)
    excess = np.bincount(index, weights=values - values.mean())
    between = k / (k - 1) * (excess**2).sum() / n**2
    size = n / max(1.0, between / binomial)
    return float(size * (Z95 / stats.t.ppf(0.975, k - 1)) ** 2)


def wilson(value: float, size: float) -> tuple[float, float]:
    """Wilson's 95% interval of a proportion seen in `size` independent trials, which need not be whole."""
    centre = (value + Z95**2 / (2 * size)) / (1 + Z95**2 / size)
    half = Z95 / (1 + Z95**2 / size) * np.sqrt(value * (1 - value) / size + Z95**2 / (4 * size**2))
    # At 0 and 1 an end is the proportion itself, but for the last bits.
    return min(value, max(0.0, float(centre - half))), max(value, min(1.0, float(centre + half)))


def proportion(success: np.ndarray, clusters: np.ndarray | None = None) -> Proportion:
    """Success rate of success (n,) bool; clusters (n,) names the object of each trial, None: every trial its own."""
    success = np.asarray(success, dtype=float)
    assert len(success) > 0
    clusters = np.arange(len(success)) if clusters is None else np.asarray(clusters)
    value = float(success.mean())
    low, high = wilson(value, effective_size(success, clusters))
    return Proportion(value, low, high, len(success), len(np.unique(clusters)))


def paired_difference(success: np.ndarray, baseline: np.ndarray, clusters: np.ndarray | None = None) -> Difference:
    """Rate of success (n,) bool less that of baseline (n,) bool: trial i of both is of the same object and placement.

    Pairing leaves out what makes an object easy or hard for both methods. The interval is Agresti and Min's for
    matched pairs (one pair is added that either method wins by half, and one tie), at the effective number of
    pairs: like Wilson's it does not collapse when the methods agree on every trial.
    """
    difference = np.asarray(success, dtype=float) - np.asarray(baseline, dtype=float)
    assert len(difference) > 0
    clusters = np.arange(len(difference)) if clusters is None else np.asarray(clusters)
    size = effective_size(difference, clusters)
    wins = (np.mean(difference > 0) * size + 0.5) / (size + 2)
    losses = (np.mean(difference < 0) * size + 0.5) / (size + 2)
    half = Z95 * np.sqrt((wins + losses - (wins - losses) ** 2) / (size + 2))
    centre = wins - losses
    return Difference(
        value=float(difference.mean()),
        low=max(-1.0, float(centre - half)),
        high=min(1.0, float(centre + half)),
        pairs=len(difference),
        clusters=len(np.unique(clusters)),
    )


RESAMPLES = 4000


@dataclass(frozen=True)
class Resampled:
    """A mean over objects, and over trained networks where there are several, with its 95% interval."""

    value: float
    low: float
    high: float
    objects: int
    networks: int


def resampled(values: np.ndarray) -> Resampled:
    """Mean of values (objects, networks), each the mean of as many trials, with the interval of resampling both.

    A network is one training seed: with one alone the interval holds for that network, not for its kind, and says
    nothing of what another start would bring. Of differences between methods, pass the difference: they are paired.
    The spread is that of objects and networks drawn anew with replacement, the two independently (Owen's pigeonhole
    bootstrap), the quantile Student's for the objects: percentiles of few objects would be too near.
    """
    assert values.ndim == 2 and values.size > 0
    objects, networks = values.shape
    value = float(values.mean())
    if objects == 1:
        return Resampled(value, -np.inf, np.inf, objects, networks)
    spread = ((_resamples(objects, 0) @ values) * _resamples(networks, 1)).sum(axis=1).std()
    # Resampling makes the variance of a mean of n too small by (n - 1) / n.
    half = float(stats.t.ppf(0.975, objects - 1) * spread * np.sqrt(objects / (objects - 1)))
    return Resampled(value, value - half, value + half, objects, networks)


@functools.cache
def _resamples(count: int, stream: int) -> np.ndarray:
    """(RESAMPLES, count) shares of `count` things drawn with replacement: the same for every row of a table."""
    return np.random.default_rng(stream).multinomial(count, np.full(count, 1 / count), RESAMPLES) / count


def resampled_rate(values: np.ndarray) -> Resampled:
    """As `resampled`, of rates in [0, 1]: the interval stays there, and does not collapse where all objects agree.

    It is Wilson's, at the number of independent trials that would spread as the resampled mean does, and at no more
    than the number of objects where there is no spread at all.
    """
    found = resampled(values)
    if not np.isfinite(found.low):
        return Resampled(found.value, *wilson(found.value, 1.0), found.objects, found.networks)
    spread = (found.high - found.value) / Z95
    binomial = found.value * (1 - found.value)
    size = binomial / spread**2 if spread > 0 and binomial > 0 else float(found.objects)
    return Resampled(found.value, *wilson(found.value, size), found.objects, found.networks)
