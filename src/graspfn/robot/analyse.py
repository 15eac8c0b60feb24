"""From recordings to a table of trials and the pose uncertainty that the robot showed (paper VII-B).

The paper measures its arm's uncertainty from commanded and achieved poses; so does this, with the interval that the
number of trials allows. Sigma is the spread about the mean error: a constant offset is a fault of calibration that a
wider Sigma would not describe and that commanding the opposite offset removes. It is reported beside it, as the bias.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from graspfn.geometry.grid import angle_difference
from graspfn.params import Topics
from graspfn.robot.read import read_trial
from graspfn.robot.trial import RecordingError

CONDITION = ["sigma_uv_mm", "sigma_theta_deg"]
TRIAL = ["object", "placement", "method", "network", *CONDITION]


def trial_row(path: Path, topics: Topics) -> dict[str, object]:
    """One row of the trials' table from one recording; its poses are NaN where the method found no grasp."""
    trial = read_trial(path, topics)
    c = trial.condition
    nowhere = np.full(3, np.nan)
    u, v, theta = (nowhere if trial.commanded is None else trial.commanded).tolist()
    reached_u, reached_v, reached_theta = (nowhere if trial.achieved is None else trial.achieved).tolist()
    return {
        "file": path.name,
        "object": c.object,
        "placement": c.placement,
        "method": c.method,
        "network": c.network,
        "sigma_uv_mm": c.sigma_uv_mm,
        "sigma_theta_deg": c.sigma_theta_deg,
        "u_m": u,
        "v_m": v,
        "theta_rad": theta,
        "reached_u_m": reached_u,
        "reached_v_m": reached_v,
        "reached_theta_rad": reached_theta,
        "success": trial.success,
        "simulated": c.simulated,
    }


def pose_errors(trials: pd.DataFrame) -> np.ndarray:
    """(n, 3) reached less commanded: u [m], v [m], theta [rad] in [-pi/2, pi/2)."""
    uv = trials[["reached_u_m", "reached_v_m"]].to_numpy() - trials[["u_m", "v_m"]].to_numpy()
    theta = angle_difference(trials["reached_theta_rad"].to_numpy(), trials["theta_rad"].to_numpy())
    return np.column_stack([uv, theta])


def independent_errors(trials: pd.DataFrame) -> np.ndarray:
    """`pose_errors` with one row per draw.

    Methods may be compared under the same errors on the same placement of an object; such an error is one
    observation of the arm, however many trials it served. A trial without a grasp to try is none.
    """
    trials = trials[trials["u_m"].notna()]
    keyed = trials[["object", "placement"]].copy()
    errors = pose_errors(trials)
    keyed[["u", "v", "theta"]] = errors.round(9)  # a nanometre: what adding to different commands rounds off
    return errors[~keyed.duplicated().to_numpy()]


def sigma_interval(sum_of_squares: float, degrees_of_freedom: int) -> tuple[float, float, float]:
    """Standard deviation of a Gaussian and its 95% chi-square interval; NaN and [0, inf) without any freedom."""
    if degrees_of_freedom < 1:
        return np.nan, 0.0, np.inf
    low, high = stats.chi2.ppf([0.975, 0.025], degrees_of_freedom)
    return (
        float(np.sqrt(sum_of_squares / degrees_of_freedom)),
        float(np.sqrt(sum_of_squares / low)),
        float(np.sqrt(sum_of_squares / high)),
    )


def uncertainty(errors: np.ndarray) -> dict[str, float]:
    """Estimate of Sigma = diag(uv, uv, theta) from errors (n, 3), u and v pooled, in mm and degrees.

    theta's mean is taken on the circle of half turns and its spread about that mean, so an error that wraps counts
    as the small one it is. Errors beyond 90 degrees cannot be told from smaller ones: an estimate above some 30
    degrees is too low. Without any errors all is NaN.
    """
    n = len(errors)
    if not n:
        errors = np.full((1, 3), np.nan)
    uv_mm = errors[:, :2] * 1000
    bias_uv = uv_mm.mean(axis=0)
    bias_theta = np.angle(np.exp(2j * errors[:, 2]).mean()) / 2
    squares_u, squares_v = ((uv_mm - bias_uv) ** 2).sum(axis=0)
    squares_theta = float((np.degrees(angle_difference(errors[:, 2], bias_theta)) ** 2).sum())
    uv, uv_low, uv_high = sigma_interval(squares_u + squares_v, 2 * (n - 1))
    theta, theta_low, theta_high = sigma_interval(squares_theta, n - 1)
    return {
        "estimated_u_mm": sigma_interval(squares_u, n - 1)[0],
        "estimated_v_mm": sigma_interval(squares_v, n - 1)[0],
        "estimated_uv_mm": uv,
        "estimated_uv_mm_low": uv_low,
        "estimated_uv_mm_high": uv_high,
        "estimated_theta_deg": theta,
        "estimated_theta_deg_low": theta_low,
        "estimated_theta_deg_high": theta_high,
        "bias_u_mm": float(bias_uv[0]),
        "bias_v_mm": float(bias_uv[1]),
        "bias_theta_deg": float(np.degrees(bias_theta)),
    }


def analyse(paths: Iterable[Path], topics: Topics) -> tuple[pd.DataFrame, pd.DataFrame]:
    """(trials, uncertainty): a row per recording sorted by what was tried, and a row per condition.

    Recordings are read one at a time; what stays of each is its row. `trials` in the second table counts the
    recordings of the condition, `draws` the independent errors behind the estimate.
    """
    rows = [trial_row(path, topics) for path in paths]
    if not rows:
        raise RecordingError("no recordings to analyse")
    trials = pd.DataFrame(rows).sort_values([*TRIAL, "file"], ignore_index=True)
    again = trials.duplicated(TRIAL)
    if again.any():
        second = int(np.flatnonzero(again)[0])
        files = " and ".join(trials["file"].iloc[second - 1 : second + 1])
        raise RecordingError(f"{files}: two recordings of the same trial ({', '.join(TRIAL)} agree)")
    estimates = []
    for (sigma_uv, sigma_theta), group in trials.groupby(CONDITION):
        errors = independent_errors(group)
        condition = {"sigma_uv_mm": sigma_uv, "sigma_theta_deg": sigma_theta}
        estimates.append({**condition, **uncertainty(errors), "trials": len(group), "draws": len(errors)})
    return trials, pd.DataFrame(estimates)
