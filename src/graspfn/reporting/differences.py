"""Methods of Table 1 against each other: by trials, and by what labels lead one to expect of their poses.

A trial is a draw of chance, and one or a few for each object leave a difference of 0.02 in a single cell undecided.
What is expected of a pose rests on all attempts near it (evaluation/expected.py), for labelled objects alone.
"""

from __future__ import annotations

import dataclasses
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
SHARE = "robust_over_ceiling"  # the one comparison that is no difference
SHOWN = ("robust_minus_best", "best_minus_centroid", "ceiling_minus_robust", SHARE)


def comparisons(network: str) -> dict[str, tuple[Method, Method]]:
    """What Table 1 is about, of a network: the first less the second; of SHARE, the first over the second."""
    best, robust, floor = (BEST, network), (ROBUST, network), (CENTROID, "")
    found = {
        "robust_minus_best": (robust, best),
        "best_minus_centroid": (best, floor),
        "robust_minus_centroid": (robust, floor),
    }
    if network == TRUE:
        return found
    likeliest, ceiling = (LIKELIEST, network), (ROBUST, TRUE)
    found |= {"robust_minus_likeliest": (robust, likeliest), "ceiling_minus_robust": (ceiling, robust)}
    return found | {SHARE: (robust, ceiling)}


def compared(
    plans: pd.DataFrame, one: Method, other: Method, by: str = TRIALS, share: bool = False
) -> Resampled | None:
    """One method less another, or its share of the other, mean over the plans' cells; None where they share no object.

    by: TRIALS, or EXPECTED, where what is known of only one of two poses is left out. Paired: object by object, cell by
    cell, and training seed by training seed where both have several, else each with the only one of the other.
    """
    wide = [
        of_method(plans, *method).pivot(index=["id", *CELL], columns="training_seed", values=by)
        for method in (one, other)
    ]
    both = wide[0].index.intersection(wide[1].index)
    first, second = np.broadcast_arrays(*(table.loc[both].to_numpy() for table in wide))
    known = ~np.isnan(first + second).any(axis=1)
    if not known.any():
        return None
    objects = both[known].get_level_values("id")
    first, second = (pd.DataFrame(part[known]).groupby(objects).mean().to_numpy() for part in (first, second))
    return share_of(first, second) if share else resampled(first - second)


def share_of(part: np.ndarray, whole: np.ndarray) -> Resampled | None:
    """Mean of part over mean of whole, (objects, networks) each, by the ratio's derivatives; None of nothing."""
    if not whole.mean():
        return None
    ratio = part.mean() / whole.mean()
    found = resampled((part - ratio * whole) / whole.mean())
    return dataclasses.replace(found, value=float(ratio), low=ratio + found.low, high=ratio + found.high)


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
                        if found := compared(part, one, other, by, share=name == SHARE):
                            interval = {"value": found.value, "ci_low": found.low, "ci_high": found.high}
                            behind = {"objects": found.objects, "networks": found.networks}
                            rows.append(key | dict(zip(CELL, cell, strict=True)) | interval | behind)
    return pd.DataFrame(rows)
