"""Sizes of objects, as they were drawn and as they were placed so that the gripper can take them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from graspfn.reporting.figures.style import BEST, ROBUST, WIDE_IN, Plate, new_figure, styled
from graspfn.reporting.sizes import AS_DRAWN, SMALLER


@styled
def draw_object_sizes(table: pd.DataFrame) -> Figure:
    """A panel for each split: histograms of the largest extent before and after; table: as `reporting.sizes` has it."""
    splits = list(dict.fromkeys(table["split"]))
    figure = new_figure(WIDE_IN, 2.7)
    high = 100 * float(table["drawn_m"].max())
    edges = np.linspace(0, np.ceil(high / 2) * 2, 2 * int(np.ceil(high / 2)) + 1)
    for axes, split in zip(figure.subplots(1, len(splits), squeeze=False)[0], splits, strict=True):
        own = table[table["split"] == split]
        axes.hist(100 * own["drawn_m"], edges, histtype="step", color=BEST, linestyle="--", label="as drawn")
        axes.hist(100 * own["placed_m"].dropna(), edges, color=ROBUST, alpha=0.55, label="as placed")
        axes.set(title=f"{split}: {len(own):,} objects", xlabel="largest extent (cm)", xlim=(edges[0], edges[-1]))
        axes.set_xticks(np.arange(0, edges[-1] + 1, 5))
        axes.yaxis.get_major_locator().set_params(integer=True)
        axes.set_ylabel("objects")
        axes.legend()
    return figure


def fates(own: pd.DataFrame) -> str:
    """Of one split: how many stayed as drawn, were made smaller, or were left out and why."""
    counts = own["fate"].value_counts().sort_index()
    left = [f"{count:,} {fate}" for fate, count in counts.items() if fate not in (AS_DRAWN, SMALLER)]
    kept = [f"{int(counts.get(fate, 0)):,} {fate}" for fate in (AS_DRAWN, SMALLER)]
    return ", ".join(kept) + (f", left out: {', '.join(left)}" if left else ", none left out")


def plates(table: pd.DataFrame, fit: bool) -> Iterator[Plate]:
    """One figure; fit: whether objects were placed at a size that fits the gripper."""
    why = (
        "An object of which no part fits the gripper is made smaller or else dropped anew in another orientation; "
        "what was dropped anew and then fitted counts as drawn. "
        if fit
        else "Objects were placed as they were drawn, whether they fit the gripper or not (settle.fit). "
    )
    said = "; ".join(f"{split}: {fates(own)}" for split, own in table.groupby("split", sort=False))
    yield Plate(
        "object_sizes",
        f"The largest extent of every object, as it was drawn and as it was placed. {why}{said[0].upper()}{said[1:]}.",
        draw_object_sizes(table),
    )
