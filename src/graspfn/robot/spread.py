"""How far an arm misses the pose it is sent to: bias and covariance Sigma, with intervals (paper VII-B).

An error is a row (u [mm], v [mm], theta [degrees]): mean + offset of its session + N(0, Sigma), but for a few outliers.
- Sigma is the spread about the mean of each session: what a new calibration moves as a whole is no spread.
- Outliers are rows whose Mahalanobis distance, by the Sigma of all others, no row of a Gaussian sample of that size
  would have but in one sample of twenty. They are named, and left out of all else. The search starts from
  Tyler's M-estimator, which a quarter of wild rows does not move.
- Intervals are 95%: of a standard deviation chi-square; of the pooled one chi-square with Satterthwaite's degrees of
  freedom, which unequal or correlated axes lower; of a correlation Fisher's z; of the bias Student's t, over sessions
  where there are several, since the rows of one share its offset.
docs/recordings.md has how often they hold the truth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

FALSE_ALARM = 0.05  # share of Gaussian samples in which a row is taken for an outlier
AXES = ("u", "v", "theta")
PAIRS = ((0, 1), (0, 2), (1, 2))
START = 0.5  # share of the rows that the search for outliers starts from
MOST_ROUNDS = 100


@dataclass(frozen=True)
class Estimate:
    """With its 95% interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.3g} [{self.low:.3g}, {self.high:.3g}]"


@dataclass(frozen=True, eq=False)
class Spread:
    """covariance: (3, 3), mm², mm · degrees, degrees². sigma: of u, v [mm], theta [degrees]; sigma_uv: of both pooled,
    the root of their mean variance. correlation: of (u, v), (u, theta), (v, theta). sessions_sigma: between the means
    of sessions, NaN where there is one. outliers: (n,) bool. normality: p of Shapiro-Wilk, the least of the axes times
    three; NaN where there are too few rows. rows, sessions: counted without outliers."""

    covariance: np.ndarray
    sigma: tuple[Estimate, Estimate, Estimate]
    sigma_uv: Estimate
    correlation: tuple[Estimate, Estimate, Estimate]
    bias: tuple[Estimate, Estimate, Estimate]
    sessions_sigma: np.ndarray
    outliers: np.ndarray
    normality: float
    rows: int
    sessions: int


def standard_deviation(mean_square: float, freedom: float) -> Estimate:
    """Of a Gaussian whose variance is estimated with so many degrees of freedom; [0, inf) without any."""
    if not freedom > 0:
        return Estimate(np.nan, 0.0, np.inf)
    low, high = stats.chi2.ppf([0.975, 0.025], freedom)
    squares = freedom * mean_square
    return Estimate(*(float(np.sqrt(value)) for value in (mean_square, squares / low, squares / high)))


def _pooled(S: np.ndarray, freedom: int) -> Estimate:
    """The root of the mean variance of u and v; S: (2, 2)."""
    if freedom < 1:
        return standard_deviation(np.nan, 0)
    # tr(S)^2 and tr(S^2) both overrate tr(Sigma^2) and the like by terms of 1/freedom; these are without bias.
    trace2, squares, n = float(np.trace(S)) ** 2, float((S * S).sum()), freedom
    if n > 1:
        scale = n / ((n - 1) * (n + 2))
        trace2, squares = scale * ((n + 1) * trace2 - 2 * squares), scale * (n * squares - trace2)
    share = np.clip(trace2 / squares if squares > 0 else 1.0, 1.0, 2.0)
    return standard_deviation(float(np.trace(S)) / 2, n * float(share))


def _correlation(S: np.ndarray, i: int, j: int, freedom: int) -> Estimate:
    scale = np.sqrt(S[i, i] * S[j, j])
    if freedom < 1 or not scale > 0:
        return Estimate(np.nan, -1.0, 1.0)
    r = float(np.clip(S[i, j] / scale, -1, 1))
    if freedom < 3 or abs(r) == 1:
        return Estimate(r, -1.0, 1.0)
    reach = stats.norm.ppf(0.975) / np.sqrt(freedom - 2)
    # Fisher's z is r / (2 freedom) too far from 0 on average.
    z = np.arctanh(r) - r / (2 * freedom)
    return Estimate(r, float(np.tanh(z - reach)), float(np.tanh(z + reach)))


def _mean(values: np.ndarray) -> list[Estimate]:
    """The mean of values (k, 3), each axis with Student's t."""
    k = len(values)
    if k < 2:
        return [Estimate(float(m), -np.inf, np.inf) for m in (values[0] if k else np.full(3, np.nan))]
    mean = values.mean(axis=0)
    reach = stats.t.ppf(0.975, k - 1) * values.std(axis=0, ddof=1) / np.sqrt(k)
    return [Estimate(float(m), float(m - r), float(m + r)) for m, r in zip(mean, reach, strict=True)]


def _residuals(errors: np.ndarray, session: np.ndarray, clean: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """errors (n, 3) less the mean of the clean rows of their session, and (n,) by which factor the covariance of such a
    residual differs from Sigma: below 1 for a row that is in the mean, above for one that is not."""
    residual, factor = np.zeros_like(errors), np.full(len(errors), np.nan)
    for s in np.unique(session):
        here = session == s
        inside = here & clean
        k = int(inside.sum())
        if not k:
            continue
        residual[here] = errors[here] - errors[inside].mean(axis=0)
        factor[here] = 1 + 1 / k
        factor[inside] = 1 - 1 / k
    return residual, factor


def _scatter(residual: np.ndarray) -> np.ndarray:
    """(3, 3) shape of residuals (n, 3) about 0 by Tyler's M-estimator, whatever their lengths."""
    lengths = np.median(np.abs(residual), axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    x = residual / lengths
    x = x[np.linalg.norm(x, axis=1) > 0]
    S = np.eye(3)
    if not len(x):
        return S
    for _ in range(MOST_ROUNDS):
        d2 = np.einsum("ni,ij,nj->n", x, np.linalg.pinv(S), x)
        new = (x / np.maximum(d2, 1e-12)[:, None]).T @ x
        new *= 3 / np.trace(new)
        done = np.abs(new - S).max() < 1e-6
        S = new
        if done:
            break
    return S * np.outer(lengths, lengths)


def find_outliers(errors: np.ndarray, session: np.ndarray) -> np.ndarray:
    """(n,) bool: which of errors (n, 3) no Gaussian would give; session: (n,) of integers."""
    n = len(errors)
    none = np.zeros(n, dtype=bool)
    medians = {s: np.median(errors[session == s], axis=0) for s in np.unique(session)}
    residual = errors - np.array([medians[s] for s in session]).reshape(n, 3)
    if n - len(medians) < 10:  # too few to tell
        return none
    d2 = np.einsum("ni,ij,nj->n", residual, np.linalg.pinv(_scatter(residual)), residual)
    clean = d2 <= np.quantile(d2, START)
    for _ in range(MOST_ROUNDS):
        new = _within(errors, session, clean)
        if (new == clean).all():
            break
        clean = new
    return ~clean


def _within(errors: np.ndarray, session: np.ndarray, clean: np.ndarray) -> np.ndarray:
    """(n,) bool: rows that belong to the clean ones, each by the Sigma of the others."""
    residual, factor = _residuals(errors, session, clean)
    freedom = int(clean.sum()) - len(np.unique(session[clean]))
    told = np.isfinite(factor) & (factor > 1e-9)  # a row that is alone in its session says nothing
    z = residual[told] / np.sqrt(factor[told])[:, None]
    inside = clean[told]
    squares = z[inside].T @ (z[inside] * factor[told][inside][:, None])
    left = freedom - inside  # of a clean row itself left out, by Sherman and Morrison: the sum of squares without it
    m = np.einsum("ni,ij,nj->n", z, np.linalg.pinv(squares), z)
    rest = np.where(inside, m / np.maximum(1 - m, 1e-12), m) * left
    limits = [_limit(freedom - one, len(errors)) for one in (0, 1)]
    within = np.ones(len(errors), dtype=bool)
    within[told] = rest <= np.where(inside, limits[1], limits[0])
    return within


def _limit(freedom: int, rows: int) -> float:
    """Hotelling's T² that none of so many rows exceeds but in one sample of twenty."""
    free = max(freedom - 2, 1)
    return float(3 * freedom / free * stats.f.ppf(1 - FALSE_ALARM / rows, 3, free))


def spread(errors: np.ndarray, session: np.ndarray | None = None) -> Spread:
    """errors: (n, 3) of (u [mm], v [mm], theta [degrees]); session: (n,) names, None for one of all."""
    n = len(errors)
    _, session = np.unique(np.zeros(n) if session is None else session, return_inverse=True)
    outliers = find_outliers(errors, session)
    kept, of = errors[~outliers], session[~outliers]
    groups = np.unique(of)
    freedom = len(kept) - len(groups)
    residual, factor = _residuals(kept, of, np.ones(len(kept), dtype=bool))
    S = residual.T @ residual / freedom if freedom > 0 else np.full((3, 3), np.nan)
    means = np.array([kept[of == s].mean(axis=0) for s in groups]).reshape(-1, 3)
    told = factor > 1e-9
    return Spread(
        covariance=S,
        sigma=tuple(standard_deviation(float(S[i, i]), freedom) for i in range(3)),  # type: ignore[arg-type]
        sigma_uv=_pooled(S[:2, :2], freedom),
        correlation=tuple(_correlation(S, i, j, freedom) for i, j in PAIRS),  # type: ignore[arg-type]
        bias=tuple(_mean(means if len(groups) > 1 else kept)),  # type: ignore[arg-type]
        sessions_sigma=means.std(axis=0, ddof=1) if len(groups) > 1 else np.full(3, np.nan),
        outliers=outliers,
        normality=_normality(residual[told] / np.sqrt(factor[told])[:, None]),
        rows=len(kept),
        sessions=len(groups),
    )


def _normality(residual: np.ndarray) -> float:
    """p of residuals (n, 3) under a Gaussian: Shapiro and Wilk's, of each axis, with Bonferroni's correction."""
    if len(residual) < 8 or not (np.ptp(residual, axis=0) > 0).all():
        return np.nan
    some = residual[:: -(-len(residual) // 5000)]  # its p is exact for so many
    return float(min(1.0, 3 * min(stats.shapiro(axis).pvalue for axis in some.T)))
