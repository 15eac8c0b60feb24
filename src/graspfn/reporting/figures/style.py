"""One look for every figure: for print, greyscale and colour-blind eyes, and the same bytes every time."""

from __future__ import annotations

import functools
import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ParamSpec

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from PIL import Image

from graspfn.imaging.camera import Camera
from graspfn.imaging.holes import holes

P = ParamSpec("P")

WIDE_IN = 7.16  # both columns of an IEEE page
COLUMN_IN = 3.5
DPI = 150
RC: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.labelsize": 8.5,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": False,
    "grid.color": "0.88",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.4,
    "lines.markersize": 5,
    "legend.frameon": False,
    "figure.constrained_layout.h_pad": 0.06,
    "figure.constrained_layout.w_pad": 0.06,
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "pdf.fonttype": 42,
}
# Okabe and Ito's palette: apart in hue for every kind of colour vision, and in lightness in greyscale.
COLOURS = {"Centroid": "#4D4D4D", "Best Grasp": "#56B4E9", "Robust Best Grasp": "#D55E00", "true function": "#009E73"}
MARKERS = {"Centroid": "^", "Best Grasp": "s", "Robust Best Grasp": "o", "true function": "D"}
LINES: dict[str, Any] = {"Centroid": (0, (1, 1.2)), "Best Grasp": (0, (5, 2)), "Robust Best Grasp": "solid"}
LINES |= {"true function": "dashdot"}
SCORE = "#B2182B"  # lines of a grasp function
ROBUST = "#D7191C"
BEST = "#0072B2"
PAPER = "0.6"
DARKEST_M = 0.15  # heights above this are as dark as it gets


@dataclass(frozen=True, eq=False)
class Plate:
    """A figure, the name of its files, and what is written under it.

    palette: whether its PNG may hold few colours.
    """

    name: str
    caption: str
    figure: Figure
    palette: bool = False


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """A drawing function under the project's settings, whatever those of the caller are."""

    @functools.wraps(draw)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with matplotlib.rc_context(RC):
            return draw(*args, **kwargs)

    return wrapped


def new_figure(width_in: float, height_in: float) -> Figure:
    """A figure without pyplot: no global state, no display."""
    return Figure(figsize=(width_in, height_in), layout="constrained")


def few_colours(picture: Image.Image) -> Image.Image:
    """An RGB picture in the 256 colours that suit it best: half the file, and no eye sees it where hues are few."""
    return picture.quantize(256, dither=Image.Dither.NONE)


def png_bytes(figure: Figure, palette: bool = False) -> bytes:
    stream = io.BytesIO()
    with matplotlib.rc_context(RC):
        figure.savefig(stream, format="png", dpi=DPI, metadata={"Software": None})
    if not palette:
        return stream.getvalue()
    smaller = io.BytesIO()
    few_colours(Image.open(stream).convert("RGB")).save(smaller, format="png", optimize=True)
    return smaller.getvalue()


def pdf_bytes(figure: Figure) -> bytes:
    stream = io.BytesIO()
    with matplotlib.rc_context(RC):
        figure.savefig(stream, format="pdf", metadata={"CreationDate": None, "Creator": None, "Producer": None})
    return stream.getvalue()


def save_plate(plate: Plate, folder: Path) -> bytes:
    """Write the plate's .png and .pdf; returns the PNG, so that the page shows the very same."""
    folder.mkdir(parents=True, exist_ok=True)
    png = png_bytes(plate.figure, plate.palette)
    (folder / f"{plate.name}.png").write_bytes(png)
    (folder / f"{plate.name}.pdf").write_bytes(pdf_bytes(plate.figure))
    return png


def interval_bars(rate: ArrayLike, low: ArrayLike, high: ArrayLike) -> np.ndarray:
    """(2, n) lengths of error bars below and above n rates, from the ends of their intervals."""
    return np.stack([np.subtract(rate, low), np.subtract(high, rate)])


def bare(axes: Axes) -> None:
    """No ticks, a thin frame: axes that hold a picture."""
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(True)
        spine.set_color("0.6")


def show_depth(axes: Axes, depth: np.ndarray, camera: Camera, window_mm: tuple[float, ...] | None = None) -> None:
    """A depth image (480, 640) [m] as heights, dark where high, holes blue; axes in mm on the table, v down.

    window_mm: (u low, u high, v low, v high) to show.
    """
    height = camera.deproject(depth)[..., 2]
    # The square root gives low objects and the noise of the table their share of the greys.
    grey = np.clip(0.95 - 0.62 * np.sign(height) * np.sqrt(np.abs(height) / DARKEST_M), 0.33, 1.0)
    rgb = np.repeat(grey[..., None], 3, axis=-1)
    rgb[holes(depth, None)] = (0.10, 0.20, 0.50)
    edges = np.array([[-0.5, -0.5], [camera.width - 0.5, camera.height - 0.5]])
    (u0, v0), (u1, v1) = camera.pixel_to_table(edges) * 1000
    axes.imshow(rgb, extent=(u0, u1, v1, v0), interpolation="nearest", aspect="equal")
    low_u, high_u, low_v, high_v = window_mm or (u0, u1, v0, v1)
    axes.set_xlim(low_u, high_u)
    axes.set_ylim(high_v, low_v)
    bare(axes)


def scale_bar(axes: Axes, length_mm: float = 50.0) -> None:
    """A bar of `length_mm` in the lower right corner of axes in mm."""
    (low_u, high_u), (high_v, _) = axes.get_xlim(), axes.get_ylim()
    margin = 0.04 * (high_u - low_u)
    v = high_v - margin
    axes.plot([high_u - margin - length_mm, high_u - margin], [v, v], color="black", linewidth=2, solid_capstyle="butt")
    axes.text(high_u - margin - length_mm / 2, v - 0.4 * margin, f"{length_mm / 10:g} cm", ha="center", va="bottom")


def window_round(depth: np.ndarray, camera: Camera, margin_mm: float = 35.0) -> tuple[float, float, float, float]:
    """A square (u low, u high, v low, v high) [mm] round what stands out of the table in a noise-free depth image."""
    rows, columns = np.nonzero(camera.deproject(depth)[..., 2] > 0.003)
    if not len(rows):
        return -80.0, 80.0, -80.0, 80.0
    corners = np.array([[columns.min(), rows.min()], [columns.max(), rows.max()]])
    low, high = camera.pixel_to_table(corners) * 1000
    return square((low + high) / 2, max((high - low).max() / 2 + margin_mm, 60.0), camera)


def square(centre_mm: np.ndarray, half_mm: float, camera: Camera) -> tuple[float, float, float, float]:
    """A square (u low, u high, v low, v high) [mm] about a point (2,), moved as little as keeps it in the image."""
    reach = np.abs(camera.pixel_to_table(np.array([-0.5, -0.5]))) * 1000
    half = min(half_mm, float(reach.min()))
    u, v = np.clip(centre_mm, half - reach, reach - half)
    return float(u - half), float(u + half), float(v - half), float(v + half)
