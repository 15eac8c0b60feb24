"""How the loss fell while the networks were trained."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from graspfn.reporting.figures.style import WIDE_IN, new_figure, styled


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
