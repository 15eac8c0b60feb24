"""Success to expect of a pose under a pose uncertainty, from attempts that were made anyway: no new physics.

Labelling attempts every cell of Q the same number of times, each attempt uniformly inside its cell (paper IV-C).
Weighted with the density of the pose that the gripper reaches, their outcomes give the success of any pose under any
uncertainty: importance sampling, stratified by the cells. Outside Q nothing was attempted; there an object that lies
within Q is out of reach, so nothing is held.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from graspfn.geometry import grid
from graspfn.planning.uncertainty import PoseUncertainty

FEW = 10.0  # effective attempts, below which an estimate of one object says little
BEYOND = 1e-6  # of the reached poses within Q: what was attempted says nothing, and nothing of the object is there
TURNS = 2  # half turns of theta either way: enough for 60 degrees of standard deviation


@dataclass(frozen=True)
class Expected:
    """Share of reached poses at which the object is held, its standard error, and the attempts that it rests on.

    effective: of the weights, (sum w)^2 / sum w^2; few below FEW. All NaN and 0 where no attempt has any weight. A pose
    beyond Q rests on all attempts, and holds in none.
    """

    value: float
    error: float
    effective: float


UNKNOWN = Expected(np.nan, np.nan, 0.0)


@dataclass(frozen=True, eq=False)
class Attempts:
    """The attempts of one object's labels.

    q: (33, 44, 6, n, 3) poses as `grid.sample_cells` draws them, n of 2 or more; held: (33, 44, 6, n) bool.
    """

    q: np.ndarray
    held: np.ndarray

    def only(self, some: np.ndarray) -> Attempts:
        """Those of every cell for which some (n,) is True."""
        return Attempts(self.q[..., some, :], self.held[..., some])


def expected_success(q: np.ndarray, sigma_uv_m: float, sigma_theta_rad: float, attempts: Attempts) -> Expected:
    """Of commanding pose q (3,) under N(q, diag(sigma_uv^2, sigma_uv^2, sigma_theta^2)), both sigmas above 0.

    q may be (n, 3), a pose for each attempt of a cell to judge; it is then the mean over these poses.
    """
    assert attempts.q.shape[:3] == grid.SHAPE and attempts.q.shape[:4] == attempts.held.shape
    inside = float(_mass_within_q(q, sigma_uv_m).mean())
    if inside < BEYOND:
        return Expected(0.0, 0.0, float(attempts.held.size))
    near = _near(q, sigma_uv_m)
    weights = _density(attempts.q[near] - q, sigma_uv_m, sigma_theta_rad)
    held, total = attempts.held[near], weights.sum()
    if total**2 == 0:
        return Expected(np.nan, np.nan, 0.0)
    ratio = (weights * held).sum() / total
    # Of a ratio by its residuals; between cells nothing varies, since each has its attempts.
    residuals = weights * (held - ratio)
    n = held.shape[-1]
    variance = n * residuals.var(axis=-1, ddof=1).sum() / total**2
    return Expected(inside * ratio, inside * float(np.sqrt(variance)), float(total**2 / (weights**2).sum()))


def expected_under(q: np.ndarray, uncertainty: PoseUncertainty, attempts: Attempts) -> Expected:
    """The same for errors that do not correlate; UNKNOWN where an axis is certain: no attempt lies just there."""
    if uncertainty.sigmas is None or not uncertainty.spreads:
        return UNKNOWN
    sigma_uv, _, sigma_theta = uncertainty.sigmas
    return expected_success(q, sigma_uv, sigma_theta, attempts)


def _near(q: np.ndarray, sigma_uv_m: float) -> tuple[slice, slice]:
    """The cells along v and u within six standard deviations of poses q (..., 3): all that has weight."""
    v, u, _ = np.moveaxis(grid.to_index(q), -1, 0)
    reach = 6 * sigma_uv_m / grid.CELL_M + 1
    return tuple(slice(max(0, int(np.floor(at.min() - reach))), max(0, int(at.max() + reach)) + 1) for at in (v, u))  # type: ignore[return-value]


def _density(offset: np.ndarray, sigma_uv_m: float, sigma_theta_rad: float) -> np.ndarray:
    """Density (...) of reaching so far from the commanded pose (..., 3), up to a factor; theta wraps."""
    uv = np.exp(-0.5 * (offset[..., :2] ** 2).sum(axis=-1) / sigma_uv_m**2)
    turned = grid.angle_difference(offset[..., 2], np.zeros(()))
    turns = (turned + turn * np.pi for turn in range(-TURNS, TURNS + 1))
    return uv * sum(np.exp(-0.5 * (angle / sigma_theta_rad) ** 2) for angle in turns)


def _mass_within_q(q: np.ndarray, sigma_uv_m: float) -> np.ndarray:
    """Probability (...) of reaching a pose in the cells of Q from poses q (..., 3)."""
    half = np.array([grid.SHAPE[1], grid.SHAPE[0]]) * grid.CELL_M / 2
    uv = q[..., :2]
    return np.prod(ndtr((half - uv) / sigma_uv_m) - ndtr((-half - uv) / sigma_uv_m), axis=-1)
