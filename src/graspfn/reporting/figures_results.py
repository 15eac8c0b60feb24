"""Figures of results: success against uncertainty (paper, Fig. 8), training, how attempts ended."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from graspfn.reporting.style import COLOURS, LINES, MARKERS, PAPER, WIDE_IN, new_figure, styled

# In the order in which an attempt can fail; `untouched` ones touch nothing and are not simulated.
OUTCOMES = {
    "held": "held: lifted 20 cm, a success",
    "left": "left: not in the gripper at the top",
    "missed": "missed: the fingers slipped off",
    "collided": "collided: the open gripper starts inside",
    "diverged": "diverged: simulation ran away",
}


@styled
def draw_success_vs_sigma_uv(table1: pd.DataFrame, sigma_theta_deg: float) -> Figure:
    """Table 1's rows of one sigma_theta: a panel per network, bands are 95% intervals, the paper's curves in grey."""
    rows = table1[table1["sigma_theta_deg"] == sigma_theta_deg]
    networks = sorted(set(rows["network"]) - {""})
    figure = new_figure(WIDE_IN, 3.3)
    panels = figure.subplots(1, len(networks), sharey=True, squeeze=False)[0]
    for axes, network in zip(panels, networks, strict=True):
        for name, line in rows[rows["network"].isin(["", network])].groupby("method", sort=False):
            method = str(name)
            line = line.sort_values("sigma_uv_mm")
            uv = line["sigma_uv_mm"].to_numpy()
            axes.plot(
                uv, line["paper"], color=PAPER, marker=MARKERS[method], markersize=4, linewidth=0.9, linestyle="--"
            )
            axes.fill_between(uv, line["ci_low"], line["ci_high"], color=COLOURS[method], alpha=0.16, linewidth=0)
            axes.plot(uv, line["success"], color=COLOURS[method], marker=MARKERS[method], linestyle=LINES[method])
        axes.set(title=network, xlabel="$\\sigma_{uv}$ (mm)", ylim=(0, 1))
        axes.set_xticks(sorted(set(rows["sigma_uv_mm"])))
        axes.grid(axis="y")
    panels[0].set_ylabel(f"success rate, $\\sigma_\\theta$ = {sigma_theta_deg:g}°")
    handles = [
        Line2D([], [], color=COLOURS[m], marker=MARKERS[m], linestyle=LINES[m], label=m)
        for m in COLOURS
        if m in set(rows["method"])
    ]
    handles.append(Line2D([], [], color=PAPER, linestyle="--", label="paper (same markers)"))
    figure.legend(handles=handles, loc="outside upper center", ncols=4)
    return figure


def smooth_curve(values: np.ndarray, width: int) -> np.ndarray:
    """Mean of the last `width` values at every step, of fewer at the start; values: (n,)."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    stop = np.arange(1, len(values) + 1)
    start = np.maximum(stop - width, 0)
    return (total[stop] - total[start]) / (stop - start)


@styled
def draw_training_curves(pretraining: Mapping[str, pd.DataFrame], training: Mapping[str, pd.DataFrame]) -> Figure:
    """Loss against epochs of every network; histories with the columns epoch, loss."""
    figure = new_figure(WIDE_IN, 2.7)
    styles = ["solid", (0, (5, 2)), (0, (1, 1.2)), "dashdot"]
    colours = ["#D55E00", "#0072B2", "#009E73", "#4D4D4D"]
    for axes, histories, title in zip(
        figure.subplots(1, 2),
        (pretraining, training),
        ("pre-training: classes", "training: grasp function"),
        strict=True,
    ):
        for i, (network, history) in enumerate(histories.items()):
            if not len(history):
                continue
            colour, style = colours[i % 4], styles[i % 4]
            loss = history["loss"].to_numpy()
            axes.plot(history["epoch"], loss, color=colour, linewidth=0.5, alpha=0.3)
            mean = smooth_curve(loss, max(1, len(loss) // 20))
            axes.plot(history["epoch"], mean, color=colour, linestyle=style, label=network)
        axes.set(title=title, xlabel="epoch", ylabel="cross-entropy")
        axes.set_ylim(bottom=0)
        axes.grid(axis="y")
        if axes.lines:
            axes.legend()
        else:
            axes.text(0.5, 0.5, "left out (0 epochs)", ha="center", transform=axes.transAxes)
    return figure


@styled
def draw_label_outcomes(account: pd.DataFrame) -> Figure:
    """How the labelling attempts ended; account: one row per object with a count for each outcome and `untouched`."""
    counts = account[list(OUTCOMES)].sum()
    culled, near = int(account["untouched"].sum()), int(counts.sum())
    figure = new_figure(WIDE_IN * 0.85, 2.3)
    axes = figure.subplots()
    shares = counts / max(near, 1)
    colours = ["#D55E00" if name == "held" else "0.6" for name in OUTCOMES]
    axes.barh(list(OUTCOMES.values()), shares, color=colours, height=0.62)
    for i, (share, count) in enumerate(zip(shares, counts, strict=True)):
        axes.text(share + 0.01, i, f"{100 * share:.1f}%  ({int(count):,})", va="center", fontsize=8)
    axes.invert_yaxis()
    axes.set(xlim=(0, min(1.25, shares.max() * 1.3 + 0.05)), xlabel="share of attempts that touch the object")
    axes.set_title(
        f"{near:,} attempts; {culled:,} more touch nothing",
        fontsize=8,
        loc="left",
    )
    return figure
