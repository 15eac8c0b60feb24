"""What the planner promised of the poses that it commanded, against what came of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from graspfn.evaluation.expected import FEW
from graspfn.evaluation.planner import TRUE
from graspfn.evaluation.statistics import proportion
from graspfn.planning.methods import ROBUST
from graspfn.reporting.figures.style import COLOURS, WIDE_IN, Plate, interval_bars, new_figure, styled
from graspfn.reporting.tables import floor_and_ceiling

BINS = 10
TOP = 1.03  # a mark at 1 stays whole
FACT, EXPECTED = COLOURS[ROBUST], "#0072B2"


def binned(plans: pd.DataFrame) -> pd.DataFrame:
    """Poses in BINS equal bins of their promise; those without one are left out.

    Of each bin its middle; the means of promise, of success with its interval (objects as clusters) and of expected
    success; and the numbers of poses and of those with an expectation. plans: as `plans_of` has them.
    """
    own = plans[plans["promise"].notna()]
    rows = []
    for number, group in own.groupby(np.minimum((BINS * own["promise"]).astype(int), BINS - 1)):
        rate = proportion(group["success"].to_numpy(), group["id"].to_numpy())
        expected = group["expected"].dropna()
        row = {"middle": (int(str(number)) + 0.5) / BINS, "promise": group["promise"].mean()}
        row |= {"success": rate.value, "ci_low": rate.low, "ci_high": rate.high}
        rows.append(row | {"expected": expected.mean(), "poses": len(group), "with_expected": len(expected)})
    columns = ["middle", "promise", "success", "ci_low", "ci_high", "expected", "poses", "with_expected"]
    return pd.DataFrame(rows, columns=columns)


@styled
def draw_promise_against_fact(plans: pd.DataFrame, networks: Sequence[str]) -> Figure:
    """A column for each network: success and expected success against promise, and below how many poses a bin holds."""
    figure = new_figure(WIDE_IN, 3.9)
    panels = figure.subplots(2, len(networks), sharex=True, sharey="row", squeeze=False, height_ratios=[3, 1])
    for (upper, lower), network in zip(panels.T, networks, strict=True):
        table = binned(plans[plans["network"] == network])
        upper.plot([0, 1], [0, 1], color="0.6", linewidth=0.8)
        bars = interval_bars(table["success"], table["ci_low"], table["ci_high"])
        upper.errorbar(table["promise"], table["success"], bars, color=FACT, marker="o", ls="none", elinewidth=0.9)
        upper.plot(table["promise"], table["expected"], "D", color=EXPECTED, markersize=5, markerfacecolor="none")
        upper.set(title=network, xlim=(0, TOP), ylim=(0, TOP), aspect="equal")
        upper.grid()
        lower.bar(table["middle"], table["poses"], 0.09, color="0.7")
        lower.set(xlabel="promise: robust score")
    panels[0, 0].set_ylabel("share that held")
    panels[1, 0].set_ylabel("poses")
    handles = [
        Line2D([], [], color=FACT, marker="o", linestyle="none", label="trials"),
        Line2D([], [], color=EXPECTED, marker="D", markerfacecolor="none", linestyle="none", label="expected"),
        Line2D([], [], color="0.6", linewidth=0.8, label="promise kept"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure


def plates(table1: pd.DataFrame, plans: pd.DataFrame) -> Iterator[Plate]:
    """One figure of all networks and the true function."""
    robust = plans[plans["method"] == ROBUST]
    networks = sorted(set(robust["network"]), key=lambda network: (network == TRUE, network))
    few = int(robust["few"].sum())
    left = (
        f" {few:,} poses have fewer than {FEW:g} effective attempts near them and no expected success." if few else ""
    )
    yield Plate(
        "promise_against_fact",
        "Promise against fact: the robust score that Robust Best Grasp saw at the pose it commanded, in ten bins, over "
        f"all cells and all {plans['id'].nunique():,} test objects, against the share of trials that held and the "
        "success expected of those poses by the objects' own attempts (labelled objects; for the true function, of "
        "other poses, planned without the attempts that judge them). Below the line more was promised than kept."
        f"{left} {floor_and_ceiling(table1)}Centroid promises nothing. Bars: 95% intervals with objects as clusters.",
        draw_promise_against_fact(robust, networks),
    )
