"""Figures of depth images: noise, hole filling, executed grasps (paper, Figs. 4, 6 and 11)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from graspfn.imaging.camera import Camera
from graspfn.imaging.holes import holes
from graspfn.reporting.figures.grasp_functions import add_pose
from graspfn.reporting.figures.style import (
    BEST,
    COLUMN_IN,
    ROBUST,
    WIDE_IN,
    new_figure,
    scale_bar,
    show_depth,
    square,
    styled,
    window_round,
)


@dataclass(frozen=True, eq=False)
class ExecutedGrasp:
    """A recorded trial: depth (480, 640) without holes, metres; commanded and reached poses (3,)."""

    name: str
    depth: np.ndarray
    commanded: np.ndarray
    reached: np.ndarray


def short(name: str, most: int = 24) -> str:
    """A name that fits over a panel: its middle left out where it is long."""
    return name if len(name) <= most else f"{name[: most // 2 - 1]}…{name[-(most // 2 - 2) :]}"


@styled
def draw_depth(depth: np.ndarray, camera: Camera) -> Figure:
    """One depth image (480, 640), metres: all of it, and what stands out of the table enlarged."""
    figure = new_figure(WIDE_IN, 3.25)
    whole, near = figure.subplots(1, 2, width_ratios=[4 / 3, 1])
    show_depth(whole, depth, camera)
    scale_bar(whole, 100)
    whole.set_title("depth image")
    show_depth(near, depth, camera, window_round(depth, camera))
    scale_bar(near)
    near.set_title("enlarged")
    return figure


@styled
def draw_noise(depth: np.ndarray, noisy: np.ndarray, camera: Camera) -> Figure:
    """A depth image (480, 640) without noise, with noise, and 4 cm at the object's edge enlarged in both."""
    figure = new_figure(WIDE_IN, 1.75)
    rows, columns = np.nonzero(camera.deproject(depth)[..., 2] > 0.003)
    # About the object's uppermost pixel in the image, where there is an edge to see.
    u, v = camera.pixel_to_table(np.array([columns[0], rows[0]])) * 1000 if len(rows) else (0.0, 0.0)
    window = (float(u) - 20, float(u) + 20, float(v) - 12, float(v) + 28)
    axes = figure.subplots(1, 4, width_ratios=[4 / 3, 4 / 3, 1, 1])
    for place, image, shown, title in (
        (0, depth, None, "noise-free"),
        (1, noisy, None, "with noise"),
        (2, depth, window, "noise-free, 4 cm"),
        (3, noisy, window, "with noise, 4 cm"),
    ):
        show_depth(axes[place], image, camera, shown)
        axes[place].set_title(title)
    for place in (0, 1):
        box = [window[i] for i in (0, 1, 1, 0, 0)], [window[i] for i in (2, 2, 3, 3, 2)]
        axes[place].plot(*box, color=ROBUST, linewidth=0.8)
    return figure


@styled
def draw_inpainting(raw: np.ndarray, filled: np.ndarray, camera: Camera, simulated: bool) -> Figure:
    """A recorded depth image (480, 640), metres, as it came and after hole filling."""
    figure = new_figure(WIDE_IN * 0.85, 2.55)
    robot = "Simulated robot" if simulated else "Robot"
    share = 100 * float(np.mean(holes(raw, None)))
    titles = (f"{robot}: {share:.1f}% without depth (blue)", "holes filled")
    for axes, image, title in zip(figure.subplots(1, 2), (raw, filled), titles, strict=True):
        show_depth(axes, image, camera)
        scale_bar(axes)
        axes.set_title(title, fontsize=8)
    return figure


@styled
def draw_example_grasps(grasps: Sequence[ExecutedGrasp], opening_mm: float, camera: Camera, simulated: bool) -> Figure:
    """Successful trials of a robot: the commanded pose and the one it reached over the depth image planned on."""
    columns = min(4, len(grasps))
    rows = -(-len(grasps) // columns)
    figure = new_figure(max(1.75 * columns, COLUMN_IN), 1.9 * rows + 0.6)
    places = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, grasp in zip(places, grasps, strict=False):
        show_depth(axes, grasp.depth, camera, square(grasp.commanded[:2] * 1000, 100, camera))
        add_pose(axes, grasp.reached, opening_mm, BEST, 1.2, linestyle=(0, (4, 1.5)))
        add_pose(axes, grasp.commanded, opening_mm, ROBUST, 1.6)
        axes.set_title(short(grasp.name), fontsize=8, parse_math=False)
    scale_bar(places[0])
    for axes in places[len(grasps) :]:
        axes.set_visible(False)
    handles = [
        Line2D([], [], color=ROBUST, label="commanded"),
        Line2D([], [], color=BEST, linestyle=(0, (4, 1.5)), label="reached"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    figure.suptitle("Successful trials of the simulated robot" if simulated else "Successful trials of the robot")
    return figure
