"""Success that an object's own attempts lead one to expect, held against the trials that were made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from graspfn.evaluation.planner import TRUE
from graspfn.evaluation.statistics import resampled
from graspfn.planning.methods import METHODS
from graspfn.reporting.plans import CELL


@dataclass(frozen=True)
class Check:
    """Expected less seen success.

    points: means of a method in a cell; chi2: sum of their squared differences over their variances; difference: mean
    over objects, with its 95% interval. plans: poses behind them; few: left out, since too few attempts lie near.
    """

    points: int
    chi2: float
    difference: float
    ci_low: float
    ci_high: float
    objects: int
    plans: int
    few: int


def _both(plans: pd.DataFrame) -> pd.DataFrame:
    """Those that were tried and have an expectation; of the true function's it is of other poses than were tried."""
    return plans[plans["expected"].notna() & (plans["network"] != TRUE)]


def points(plans: pd.DataFrame) -> pd.DataFrame:
    """A line for every method, network and cell: success and expected over the poses that have both, their errors, n.

    plans: as `plans_of` has them. Errors are those given the objects and poses: of the trials by the binomial of what
    was expected of each pose, of the expectation by its attempts.
    """
    both = _both(plans)
    p = both["expected"]
    both = both.assign(of_trials=p * (1 - p) / both["trials"], of_expected=both["expected_error"] ** 2)
    grouped = both.groupby(["method", "network", *CELL])
    table = grouped[["success", "expected"]].mean()
    n = grouped.size()
    for name in ("of_trials", "of_expected"):
        table[name] = np.sqrt(grouped[name].sum()) / n
    table = table.assign(n=n).reset_index()
    order = table["method"].map(METHODS.index)
    return table.assign(order=order).sort_values(["order", "network", *CELL], ignore_index=True).drop(columns="order")


def check_expected(plans: pd.DataFrame) -> Check:
    """All points together; NaN where no object has an expectation."""
    table, few = points(plans), int(plans.loc[plans["network"] != TRUE, "few"].sum())
    if table.empty:
        return Check(0, np.nan, np.nan, np.nan, np.nan, 0, 0, few)
    variance = table["of_trials"] ** 2 + table["of_expected"] ** 2
    squared = (table["expected"] - table["success"]) ** 2
    certain = variance == 0
    chi2 = float((squared[~certain] / variance[~certain]).sum())
    both = _both(plans)
    per_object = (both["expected"] - both["success"]).groupby(both["id"]).mean()
    mean = resampled(per_object.to_numpy()[:, None])
    return Check(int((~certain).sum()), chi2, mean.value, mean.low, mean.high, mean.objects, len(both), few)
