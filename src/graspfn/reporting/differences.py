"""Differences between the methods of Table 1: by trials, and by what the labels lead one to expect of the same poses.

A trial is a draw of chance, and one or a few for each object leave a difference of 0.02 in a single cell undecided.
What is expected of a pose rests on all attempts near it (evaluation/expected.py), for labelled objects alone.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
import pandas as pd

from graspfn.evaluation.planner import TRUE
from graspfn.evaluation.statistics import Resampled, resampled
from graspfn.planning.methods import BEST, CENTROID, LIKELIEST, ROBUST
from graspfn.reporting.plans import CELL, blocks, of_cell, of_method

Method = tuple[str, str]  # a method and its network
TRIALS, EXPECTED = "success", "expected"  # columns of plans
SHOWN = ("robust_minus_best", "best_minus_centroid", "ceiling_minus_robust")


def comparisons(network: str) -> dict[str, tuple[Method, Method]]:
    """The differences of a network that Table 1 is about: the first less the second."""
    best, robust, floor = (BEST, network), (ROBUST, network), (CENTROID, "")
    found = {
        "robust_minus_best": (robust, best),
        "best_minus_centroid": (best, floor),
        "robust_minus_centroid": (robust, floor),
    }
    if network == TRUE:
        return found
    likeliest, ceiling = (LIKELIEST, network), (ROBUST, TRUE)
    return found | {"robust_minus_likeliest": (robust, likeliest), "ceiling_minus_robust": (ceiling, robust)}


def compared(plans: pd.DataFrame, one: Method, other: Method, by: str = TRIALS) -> Resampled | None:
    """One method less another, mean over the plans' cells; None where they share no object.

    by: TRIALS, or EXPECTED, where what is known of only one of two poses is left out. Paired: object by object, cell by
    cell, and training seed by training seed where both have several, else each with the only one of the other.
    """
    wide = [
        of_method(plans, *method).pivot(index=["id", *CELL], columns="training_seed", values=by)
        for method in (one, other)
    ]
    both = wide[0].index.intersection(wide[1].index)
    gaps = wide[0].loc[both].to_numpy() - wide[1].loc[both].to_numpy()
    known = ~np.isnan(gaps).any(axis=1)
    if not known.any():
        return None
    objects = both[known].get_level_values("id")
    return resampled(pd.DataFrame(gaps[known]).groupby(objects).mean().to_numpy())


def cells_of(plans: pd.DataFrame) -> list[tuple[float, float]]:
    """(sigma_theta [deg], sigma_uv [mm]), in the order of Table 1."""
    return sorted(plans[CELL].drop_duplicates().itertuples(index=False, name=None))


def differences(plans: pd.DataFrame, graspable: Collection[str]) -> pd.DataFrame:
    """A line for every network, comparison, way to judge and cell, and one for all cells together, of each block.

    Columns: objects_of, network, comparison, by (TRIALS or EXPECTED), sigma_theta_deg, sigma_uv_mm (NaN of all
    together), value, ci_low, ci_high (95%), objects, networks.
    """
    rows: list[dict[str, Any]] = []
    for block, of_block in blocks(plans, graspable).items():
        parts = {cell: of_cell(of_block, cell[1], cell[0]) for cell in cells_of(of_block)}
        parts[np.nan, np.nan] = of_block
        for network in sorted(set(of_block["network"]) - {""}):
            for name, (one, other) in comparisons(network).items():
                for by in (TRIALS, EXPECTED):
                    key = {"objects_of": block, "network": network, "comparison": name, "by": by}
                    for cell, part in parts.items():
                        if found := compared(part, one, other, by):
                            interval = {"value": found.value, "ci_low": found.low, "ci_high": found.high}
                            behind = {"objects": found.objects, "networks": found.networks}
                            rows.append(key | dict(zip(CELL, cell, strict=True)) | interval | behind)
    return pd.DataFrame(rows)
