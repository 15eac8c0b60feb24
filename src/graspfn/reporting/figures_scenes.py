"""Figures of scenes rendered in three dimensions: a simulated grasp (paper, Fig. 3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from graspfn.reporting.style import WIDE_IN, bare, new_figure, styled


@styled
def draw_simulated_grasp(shots: Sequence[tuple[str, np.ndarray]]) -> Figure:
    """A filmstrip of (title, (height, width, 3) image in [0, 1])."""
    figure = new_figure(WIDE_IN, 2.85)
    for axes, (title, image) in zip(figure.subplots(1, len(shots), squeeze=False)[0], shots, strict=True):
        axes.imshow(image, interpolation="antialiased")
        axes.set_title(title)
        bare(axes)
    return figure
