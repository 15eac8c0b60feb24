"""How the attempts that label objects ended."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from graspfn.reporting.figures.style import WIDE_IN, new_figure, styled

# In the order in which an attempt can fail; `untouched` ones touch nothing and are not simulated.
OUTCOMES = {
    "held": "held: lifted 20 cm, a success",
    "left": "left: not in the gripper at the top",
    "missed": "missed: the fingers slipped off",
    "collided": "collided: the open gripper starts inside",
    "diverged": "diverged: simulation ran away",
}


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
