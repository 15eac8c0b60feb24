"""Expected success against the trials: a check of the one by the other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from graspfn.evaluation.expected import FEW
from graspfn.planning.methods import LIKELIEST
from graspfn.reporting.expectation import check_expected, points
from graspfn.reporting.figures.style import COLOURS, COLUMN_IN, Plate, new_figure, styled
from graspfn.reporting.tables import floor_and_ceiling, full_name

HUES = {LIKELIEST: "#0072B2"} | COLOURS
SHAPES = "osDvPX*"  # of networks


@styled
def draw_expected_against_trials(table: pd.DataFrame) -> Figure:
    """A mark for each method in each cell, with standard errors either way; table: as `points` has them."""
    figure = new_figure(COLUMN_IN + 1.6, COLUMN_IN + 1.2)
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color="0.6", linewidth=0.8)
    shapes = {network: SHAPES[i % len(SHAPES)] for i, network in enumerate(sorted(set(table["network"]) - {""}))}
    for (method, network), own in table.groupby(["method", "network"], sort=False):
        axes.errorbar(
            own["expected"], own["success"], own["of_trials"], own["of_expected"], color=HUES[str(method)],
            marker=shapes.get(network, "^"), markersize=4, linestyle="none", elinewidth=0.6,
            label=full_name(str(method), str(network)),
        )  # fmt: skip
    reach = np.concatenate([table["expected"], table["success"]])
    low, high = max(0.0, reach.min() - 0.08), min(1.03, reach.max() + 0.08)
    axes.set(xlim=(low, high), ylim=(low, high), aspect="equal")
    axes.set(xlabel="expected, from the attempts of the labels", ylabel="success in the trials")
    axes.grid()
    axes.legend(loc="lower right", frameon=True, edgecolor="none")
    return figure


def plates(table1: pd.DataFrame, plans: pd.DataFrame) -> Iterator[Plate]:
    """One figure, where objects have attempts to reckon from."""
    table, check = points(plans), check_expected(plans)
    if table.empty:
        return
    left = (
        f" {check.few:,} poses with fewer than {FEW:g} effective attempts near them are left out." if check.few else ""
    )
    yield Plate(
        "expected_against_trials",
        "Two ways to the same number: success expected of the commanded poses by the objects' own attempts, weighted "
        "with the density of the pose reached, against success in the trials, a mark for each method in each cell. "
        f"Bars: one standard error, given the objects. Expected less seen is {check.difference:+.3f} "
        f"[{check.ci_low:+.3f}, {check.ci_high:+.3f}] over {check.objects:,} objects; χ² = {check.chi2:.0f} of "
        f"{check.points:,} marks, which are not independent, since methods and cells share their errors.{left} "
        f"{floor_and_ceiling(table1)}The ceiling is not shown: what is expected of it is of poses planned without the "
        "attempts that judge them, others than were tried.".replace("-", "−"),
        draw_expected_against_trials(table),
    )
