"""A contact sheet: pictures of many objects in one image (paper, Fig. 9), large if they are few, small if many."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from graspfn.reporting.figures.style import DPI, WIDE_IN, few_colours, styled

WIDTH_PX = round(WIDE_IN * DPI)
FEWEST_COLUMNS, MOST_COLUMNS = 4, 20
NAMED_PX = 100  # narrower pictures have no room for a name
LETTER_PX, LINE_PX = 9.6, 19  # of a name, on average and from one line to the next
HEADING_PX = 40

Group = tuple[str, Sequence[str]]  # a heading, and the names of the objects under it


@dataclass(frozen=True)
class Cells:
    """Square pictures, so many side by side, with room for some lines of text under each."""

    columns: int
    lines: int

    @property
    def pitch_px(self) -> int:
        return WIDTH_PX // self.columns

    @property
    def side_px(self) -> int:
        return self.pitch_px - (8 if self.lines else 2)

    @property
    def height_px(self) -> int:
        return self.pitch_px + self.lines * LINE_PX

    def wrapped(self, name: str) -> list[str]:
        """A name in at most two lines that are about as wide as the picture, or less."""
        fit = int(self.side_px / LETTER_PX)
        words = re.sub(r"[_-]+", " ", name)
        lines = textwrap.wrap(words, fit, max_lines=2, placeholder="…", break_long_words=False)
        return [line if len(line) <= fit else line[: fit - 1] + "…" for line in lines]


def cells_for(groups: Sequence[Group]) -> Cells:
    """About as many columns as rows, within limits; names where they fit."""
    names = [name for _, names in groups for name in names]
    columns = int(np.clip(np.ceil(np.sqrt(len(names))), FEWEST_COLUMNS, MOST_COLUMNS))
    cells = Cells(columns, lines=1)
    if cells.pitch_px < NAMED_PX:
        return Cells(columns, lines=0)
    return Cells(columns, max(len(cells.wrapped(name)) for name in names))


def _paper(height_px: int) -> tuple[Figure, Axes]:
    """A figure whose axes count pixels from the upper left corner."""
    figure = Figure(figsize=(WIDTH_PX / DPI, height_px / DPI))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    return figure, axes


@styled
def draw_contact_sheet(groups: Sequence[Group], cells: Cells, pictures: Iterator[np.ndarray]) -> Figure:
    """Pictures (cells.side_px, cells.side_px, 3) uint8 of all objects of all groups, in this order.

    They are pasted into one image, which a file holds in full and without resampling: axes for each would take minutes.
    """
    heights = [HEADING_PX + -(-len(names) // cells.columns) * cells.height_px for _, names in groups]
    figure, axes = _paper(sum(heights))
    canvas = np.full((sum(heights), WIDTH_PX, 3), 255, dtype=np.uint8)
    top = 0
    for (heading, names), height in zip(groups, heights, strict=True):
        axes.text(2, top + HEADING_PX - 10, heading, fontsize=9.5)
        for i, name in enumerate(names):
            row, column = divmod(i, cells.columns)
            x, y = column * cells.pitch_px, top + HEADING_PX + row * cells.height_px
            canvas[y : y + cells.side_px, x : x + cells.side_px] = next(pictures)
            for k, line in enumerate(cells.wrapped(name)[: cells.lines], 1):
                baseline = y + cells.side_px + k * LINE_PX - 4
                axes.text(x + cells.side_px / 2, baseline, line, fontsize=8, ha="center", parse_math=False)
        top += height
    picture = np.asarray(few_colours(Image.fromarray(canvas)).convert("RGB"))
    axes.imshow(picture, interpolation="none", aspect="auto", extent=(0, WIDTH_PX, sum(heights), 0))
    return figure
