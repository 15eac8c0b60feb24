"""How often the 95% intervals of robot/spread.py hold the truth: `python benchmarks/spread.py [SAMPLES]`.

Prints the table of docs/recordings.md: percent of samples, for each kind of error and number of trials.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from graspfn.robot.spread import PAIRS, spread

SIZES = (20, 50, 200)


@dataclass(frozen=True)
class Case:
    """sigma: of u, v [mm], theta [degrees]; correlation: of (u, v), (u, theta), (v, theta); outliers: share of trials,
    so many sigma away; sessions, each with an offset of its own of std offset."""

    sigma: tuple[float, float, float] = (6.2, 6.2, 4.7)
    correlation: tuple[float, float, float] = (0, 0, 0)
    bias: tuple[float, float, float] = (0, 0, 0)
    outliers: float = 0.0
    away: tuple[float, float] = (10, 30)
    sessions: int = 1
    offset: float = 0.0

    @property
    def covariance(self) -> np.ndarray:
        R = np.eye(3)
        for (i, j), r in zip(PAIRS, self.correlation, strict=True):
            R[i, j] = R[j, i] = r
        return R * np.outer(self.sigma, self.sigma)

    @property
    def truth(self) -> tuple[float, ...]:
        return (*self.sigma, float(np.hypot(*self.sigma[:2]) / np.sqrt(2)), *self.correlation, *self.bias)

    def draw(self, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """errors (n, 3) and their sessions (n,)."""
        errors = rng.standard_normal((n, 3)) @ np.linalg.cholesky(self.covariance).T + self.bias
        session = np.arange(n) % self.sessions
        errors += (rng.standard_normal((self.sessions, 3)) * self.offset)[session]
        wild = rng.choice(n, round(self.outliers * n), replace=False)
        away = rng.standard_normal((len(wild), 3))
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        errors[wild] += away * rng.uniform(*self.away, (len(wild), 1)) * self.sigma
        return errors, session


CASES = {
    "plain": Case(),
    "biased": Case(bias=(10, -20, 8)),
    "correlated": Case(correlation=(0.9, 0.5, 0.5)),
    "unequal": Case(sigma=(3, 9, 4.7)),
    "2% outliers": Case(outliers=0.02),
    "2% outliers, near": Case(outliers=0.02, away=(5, 10)),
    "5 sessions": Case(sessions=5, offset=8),
    "all of these": Case((3, 9, 4.7), (0.8, 0.3, 0.3), (10, -20, 8), 0.02, sessions=5, offset=8),
}
NAMES = ("σu", "σv", "σθ", "σuv", "ρuv", "ρuθ", "ρvθ", "bias u", "bias v", "bias θ")


def coverage(case: Case, n: int, samples: int, seed: int = 0) -> np.ndarray:
    """Share of samples in which each of NAMES lies in its interval."""
    rng = np.random.default_rng([seed, n])
    held = np.zeros(len(NAMES))
    for _ in range(samples):
        found = spread(*case.draw(n, rng))
        estimates = (*found.sigma, found.sigma_uv, *found.correlation, *found.bias)
        held += [one.low <= true <= one.high for one, true in zip(estimates, case.truth, strict=True)]
    return held / samples


def main() -> None:
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else 3000
    print("| errors | trials |", " | ".join(NAMES), "|")
    print("|---|---|" + "---|" * len(NAMES))
    for name, case in CASES.items():
        for n in SIZES:
            shares = " | ".join(f"{100 * share:.1f}" for share in coverage(case, n, samples))
            print(f"| {name} | {n} | {shares} |", flush=True)


if __name__ == "__main__":
    main()
