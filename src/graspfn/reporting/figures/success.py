"""Success against uncertainty and against width: ours, the floor, the ceiling, and the paper's (paper, Fig. 7)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from graspfn.evaluation.planner import TRUE
from graspfn.evaluation.statistics import resampled_rate
from graspfn.planning.methods import BEST, CENTROID, ROBUST
from graspfn.reporting.figures.style import (
    COLOURS,
    LINES,
    MARKERS,
    PAPER,
    WIDE_IN,
    Plate,
    interval_bars,
    new_figure,
    styled,
)
from graspfn.reporting.plans import GRASPABLE, block_to_show, blocks, of_cell, of_method, per_object
from graspfn.reporting.tables import block_names, floor_and_ceiling, what_intervals_hold

CEILING = "true function"
SHOWN = (CENTROID, BEST, ROBUST)
BIN_MM = 20.0
TOP = 1.03  # of an axis of rates: a mark at 1 stays whole
NEAR_CELLS = ((5.0, 10.0), (20.0, 10.0))  # sigma_uv [mm], sigma_theta [deg], or what is nearest to them


def curves(network: str) -> dict[str, tuple[str, str]]:
    """(method, network) of every curve, by the name of its look: floor, the network's, ceiling."""
    return {CENTROID: (CENTROID, ""), BEST: (BEST, network), ROBUST: (ROBUST, network), CEILING: (ROBUST, TRUE)}


def _look(name: str) -> dict[str, Any]:
    return {"color": COLOURS[name], "marker": MARKERS[name], "linestyle": LINES[name]}


def _handles(names: list[str]) -> list[Line2D]:
    labels = {CENTROID: "Centroid (floor)", CEILING: "Robust Best Grasp, true function (ceiling)"}
    return [Line2D([], [], label=labels.get(name, name), **_look(name)) for name in names]


def _curve(axes: Axes, x: np.ndarray, line: pd.DataFrame, name: str) -> None:
    axes.fill_between(x, line["ci_low"], line["ci_high"], color=COLOURS[name], alpha=0.15, linewidth=0)
    axes.plot(x, line["success"], **_look(name))


@styled
def draw_success_vs_sigma_uv(rows: pd.DataFrame, network: str, whom: str) -> Figure:
    """A panel for each sigma_theta; rows: one block of Table 1, of the objects `whom`.

    Bands are 95% intervals, the paper's curves grey.
    """
    thetas = sorted(set(rows["sigma_theta_deg"]))
    columns = min(2, len(thetas))
    lines = -(-len(thetas) // columns)
    figure = new_figure(WIDE_IN if columns > 1 else WIDE_IN * 0.6, 2.5 * lines + 0.6)
    panels = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
    shown = {name: of_method(rows, *key) for name, key in curves(network).items()}
    for axes, theta in zip(panels.flat, thetas, strict=False):
        for name, own in shown.items():
            line = own[own["sigma_theta_deg"] == theta].sort_values("sigma_uv_mm")
            if line.empty:
                continue
            uv = line["sigma_uv_mm"].to_numpy()
            if name != CEILING:
                axes.plot(uv, line["paper"], color=PAPER, marker=MARKERS[name], markersize=4, lw=0.9, ls="--")
            _curve(axes, uv, line, name)
        axes.set_title(f"$\\sigma_\\theta$ = {theta:g}°")
        axes.set_ylim(0, TOP)
        axes.set_xticks(sorted(set(rows["sigma_uv_mm"])))
        axes.grid(axis="y")
    for axes in panels.flat[len(thetas) :]:
        axes.set_visible(False)
    for axes in panels[-1]:
        axes.set_xlabel("$\\sigma_{uv}$ (mm)")
    for axes in panels[:, 0]:
        axes.set_ylabel("success rate")
    handles = _handles([name for name, own in shown.items() if len(own)])
    handles.append(Line2D([], [], color=PAPER, linestyle="--", label="paper (same markers)"))
    figure.legend(handles=handles, loc="outside upper center", ncols=3, title=f"{network}, {whom}")
    return figure


def series(table1: pd.DataFrame, network: str) -> pd.DataFrame:
    """Success of every curve at every sigma_uv_mm, mean over sigma_theta, for `dvc plots`; table1: of all blocks."""
    rows = table1[table1["objects_of"] == block_to_show(dict.fromkeys(table1["objects_of"]))]
    shown = {
        name.lower().replace(" ", "_"): of_method(rows, *key).groupby("sigma_uv_mm")["success"].mean()
        for name, key in curves(network).items()
    }
    return pd.DataFrame(shown).reset_index()


def nearest_cell(plans: pd.DataFrame, wanted: tuple[float, float]) -> tuple[float, float]:
    """The cell (sigma_uv [mm], sigma_theta [deg]) that is nearest to a wanted one."""
    cells = set(zip(plans["sigma_uv_mm"], plans["sigma_theta_deg"], strict=True))
    return min(cells, key=lambda cell: (abs(cell[0] - wanted[0]) + abs(cell[1] - wanted[1]), cell))


def by_width(plans: pd.DataFrame, widths_m: Mapping[str, float]) -> pd.DataFrame:
    """Success of one method in bins of BIN_MM of the objects' width: low_mm of each, success, ci_low, ci_high, objects.

    widths_m: by id, of every object of the plans.
    """
    values = per_object(plans)
    low = BIN_MM * np.floor(1e3 * values.index.map(widths_m).to_numpy(dtype=float) / BIN_MM)
    rows = []
    for low_mm, group in values.groupby(low):
        rate = resampled_rate(group.to_numpy())
        rows.append({"low_mm": low_mm, "success": rate.value, "ci_low": rate.low, "ci_high": rate.high})
        rows[-1]["objects"] = rate.objects
    return pd.DataFrame(rows, columns=["low_mm", "success", "ci_low", "ci_high", "objects"])


@styled
def draw_success_vs_width(
    plans: pd.DataFrame, widths_m: Mapping[str, float], network: str, cells: list[tuple[float, float]]
) -> Figure:
    """A panel for each cell (sigma_uv [mm], sigma_theta [deg]): success in bins of width, with 95% intervals."""
    figure = new_figure(WIDE_IN, 3.3)
    panels = figure.subplots(1, len(cells), sharey=True, squeeze=False)[0]
    names: list[str] = []
    for axes, (uv, theta) in zip(panels, cells, strict=True):
        counts: dict[float, int] = {}
        here = of_cell(plans, uv, theta)
        for i, (name, key) in enumerate(curves(network).items()):
            own = of_method(here, *key)
            if own.empty:
                continue
            names += [name] if name not in names else []
            line = by_width(own, widths_m)
            # Side by side inside the bin, so that bars do not cover each other.
            x = line["low_mm"].to_numpy() + BIN_MM * (0.5 + 0.13 * (i - 1.5))
            bars = interval_bars(line["success"], line["ci_low"], line["ci_high"])
            axes.errorbar(x, line["success"], bars, elinewidth=0.8, linewidth=0.8, markersize=4.5, **_look(name))
            counts |= {low: max(n, counts.get(low, 0)) for low, n in zip(line["low_mm"], line["objects"], strict=True)}
        for low, count in counts.items():
            label = f"n = {count}" if low == min(counts) else f"{count}"  # many bins leave no room for more
            axes.text(low + BIN_MM / 2, 1.05, label, ha="center", va="bottom", fontsize=8, color="0.35")
        edges = np.arange(min(counts), max(counts) + 1.5 * BIN_MM, BIN_MM)
        axes.set(xticks=edges, xlim=(edges[0], edges[-1]), ylim=(0, TOP), xlabel="narrowest width seen from above (mm)")
        axes.set_title(f"$\\sigma_{{uv}}$ = {uv:g} mm, $\\sigma_\\theta$ = {theta:g}°", pad=20)
        axes.grid(axis="y")
    panels[0].set_ylabel("success rate")
    figure.legend(handles=_handles(names), loc="outside upper center", ncols=4, title=network)
    return figure


def plates(
    table1: pd.DataFrame,
    plans: pd.DataFrame,
    graspable: frozenset[str],
    widths_m: Mapping[str, float],
    networks: list[str],
) -> Iterator[Plate]:
    """Success against sigma_uv of every network, and against width of the first; networks: the best one first."""
    found = blocks(plans, graspable)
    block = block_to_show(found)
    rows = table1[table1["objects_of"] == block]
    whom = block_names(table1)[block]
    whom = whom[0].lower() + whom[1:]
    theirs = "" if block == GRASPABLE else "; which of them can be held is not known without labels"
    for i, network in enumerate(networks):
        yield Plate(
            "success_vs_sigma_uv" if i == 0 else f"success_vs_sigma_uv_{network}",
            f"Table 1 for {network} on {whom}{theirs}: success rate against σuv, a panel for each σθ. "
            f"{floor_and_ceiling(table1)}Bands are {what_intervals_hold(rows)}. Dashed grey lines with the same "
            "markers are the paper's, on 1000 objects of its own.",
            draw_success_vs_sigma_uv(rows, network, whom),
        )
    cells = list(dict.fromkeys(nearest_cell(plans, cell) for cell in NEAR_CELLS))
    yield Plate(
        "success_vs_width",
        f"Success rate against the narrowest width of the object as it was placed, seen from above, on {whom}, in bins "
        f"of {BIN_MM:g} mm. n: objects in the bin. {floor_and_ceiling(table1)}Bars: 95% intervals from "
        "resampling the objects of the bin.",
        draw_success_vs_width(found[block], widths_m, networks[0], cells),
    )
