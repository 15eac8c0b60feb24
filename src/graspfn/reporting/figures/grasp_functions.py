"""Figures of grasp functions: lines over depth images, as thick as their score (paper, Figs. 1, 4 and 10)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from graspfn.geometry import grid
from graspfn.imaging.camera import Camera
from graspfn.reporting.figures.style import (
    BEST,
    COLUMN_IN,
    ROBUST,
    SCORE,
    WIDE_IN,
    new_figure,
    scale_bar,
    show_depth,
    styled,
    window_round,
)

COARSE = 3  # every third pose along u and v
FAINT = 0.05  # lines of lower scores would be thinner than ink


def add_function(axes: Axes, f: np.ndarray, every: int = 1, thickest_pt: float = 1.6) -> None:
    """Lines at the poses of Q whose thickness is the score; f: (33, 44, 6) in [0, 1].

    A line points along the closing direction. It is as long as the spacing of the lines shown, not as the gripper is
    wide (10 cm would hide everything).
    """
    start = every // 2
    q, score = grid.poses()[start::every, start::every].reshape(-1, 3), f[start::every, start::every].ravel()
    shown = score > FAINT
    q, score = q[shown], score[shown]
    half = 0.46 * every * grid.CELL_M * 1000
    direction = half * np.stack([np.cos(q[:, 2]), np.sin(q[:, 2])], axis=-1)
    centre = q[:, :2] * 1000
    segments = np.stack([centre - direction, centre + direction], axis=1)
    axes.add_collection(
        LineCollection(list(segments), linewidths=thickest_pt * score, colors=SCORE, alpha=0.85, capstyle="butt")
    )


def add_pose(
    axes: Axes, q: np.ndarray | None, opening_mm: float, colour: str, width_pt: float = 1.8, **line: Any
) -> None:
    """A gripper pose (3,): a line between the open fingers, closed off by them; None: words that there is none."""
    if q is None:
        axes.text(0.5, 0.05, "no grasp", color=colour, ha="center", transform=axes.transAxes)
        return
    centre, direction = np.asarray(q[:2]) * 1000, np.array([np.cos(q[2]), np.sin(q[2])])
    ends = centre + opening_mm / 2 * np.array([[-1], [1]]) * direction
    across = 10 * np.array([-direction[1], direction[0]])
    axes.plot(*ends.T, color=colour, linewidth=width_pt, **line)
    for end in ends:
        axes.plot(*np.stack([end - across, end + across]).T, color=colour, linewidth=width_pt * 1.8)


@styled
def draw_grasp_function(depth: np.ndarray, f: np.ndarray, camera: Camera) -> Figure:
    """One grasp function f (33, 44, 6) over its depth image (480, 640): every pose of Q, and every third."""
    figure = new_figure(WIDE_IN, 3.75)
    window = window_round(depth, camera)
    for axes, every, title in zip(
        figure.subplots(1, 2), (1, COARSE), ("every pose of Q", "every third pose, for legibility"), strict=True
    ):
        show_depth(axes, depth, camera, window)
        add_function(axes, f, every, thickest_pt=1.5 * every)
        scale_bar(axes)
        axes.set_title(title)
    return figure


@styled
def draw_training_example(depth: np.ndarray, noisy: np.ndarray, f: np.ndarray, camera: Camera) -> Figure:
    """a: noise-free depth; b: zoomed, with noise; c: the labelled grasp function f (33, 44, 6); d: coarser."""
    figure = new_figure(WIDE_IN, 1.95)
    window = window_round(depth, camera)
    a, b, c, d = figure.subplots(1, 4, width_ratios=[4 / 3, 1, 1, 1])
    show_depth(a, depth, camera)
    scale_bar(a, 100)
    show_depth(b, noisy, camera, window)
    for axes, every in ((c, 1), (d, COARSE)):
        show_depth(axes, depth, camera, window)
        add_function(axes, f, every, thickest_pt=0.8 * every)
    titles = ("(a) depth image", "(b) with noise, zoomed", "(c) grasp function", "(d) coarser")
    for axes, title in zip((a, b, c, d), titles, strict=True):
        axes.set_title(title)
    return figure


@styled
def draw_predictions(
    depths: Sequence[np.ndarray],
    functions: Mapping[str, Sequence[np.ndarray]],
    poses: Mapping[str, Sequence[tuple[np.ndarray | None, np.ndarray | None]]],
    opening_mm: float,
    camera: Camera,
) -> Figure:
    """Rows: test images; columns: networks. Each predicted function with its Best and Robust Best pose (3,).

    functions[network][row]: (33, 44, 6); poses[network][row]: (best, robust), None where there is no grasp.
    """
    networks = list(functions)
    figure = new_figure(1.75 * (len(networks) + 1) + 0.2, 1.72 * len(depths) + 0.4)
    grid_of_axes = figure.subplots(len(depths), len(networks) + 1, squeeze=False)
    for row, depth in enumerate(depths):
        window = window_round(depth, camera, margin_mm=60)
        show_depth(grid_of_axes[row, 0], depth, camera, window)
        scale_bar(grid_of_axes[row, 0])
        for axes, network in zip(grid_of_axes[row, 1:], networks, strict=True):
            show_depth(axes, depth, camera, window)
            add_function(axes, functions[network][row], thickest_pt=1.0)
            best, robust = poses[network][row]
            add_pose(axes, best, opening_mm, BEST, 1.4, linestyle=(0, (4, 1.5)))
            add_pose(axes, robust, opening_mm, "black", 1.6)
    for axes, title in zip(grid_of_axes[0], ["depth", *networks], strict=True):
        axes.set_title(title)
    handles = [
        Line2D([], [], color=SCORE, label="score (thickness)"),
        Line2D([], [], color=BEST, linestyle=(0, (4, 1.5)), label="Best Grasp"),
        Line2D([], [], color="black", label="Robust Best Grasp"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


@styled
def draw_growing_uncertainty(
    depths: Sequence[np.ndarray],
    poses: Sequence[Sequence[np.ndarray | None]],
    sigmas: Sequence[tuple[float, float]],
    opening_mm: float,
    camera: Camera,
) -> Figure:
    """Rows: test images; columns: Sigma (sigma_uv [mm], sigma_theta [deg]). The robust poses[row][column] in red."""
    figure = new_figure(1.72 * len(sigmas) + 0.2, 1.72 * len(depths) + 0.35)
    grid_of_axes = figure.subplots(len(depths), len(sigmas), squeeze=False)
    for depth, of_depth, row in zip(depths, poses, grid_of_axes, strict=True):
        window = window_round(depth, camera, margin_mm=60)
        for axes, q in zip(row, of_depth, strict=True):
            show_depth(axes, depth, camera, window)
            add_pose(axes, q, opening_mm, ROBUST)
        scale_bar(row[0])
    for axes, (uv, theta) in zip(grid_of_axes[0], sigmas, strict=True):
        axes.set_title(f"$\\sigma_{{uv}}$ = {uv:g} mm, $\\sigma_\\theta$ = {theta:g}°", fontsize=8)
    return figure


@styled
def draw_summary_1d(u_mm: np.ndarray, f: np.ndarray, smoothed: np.ndarray, sigma_mm: float) -> Figure:
    """A slice f(u) of a grasp function and the same smoothed with sigma_mm; u_mm, f, smoothed: (n,)."""
    figure = new_figure(COLUMN_IN + 0.6, 2.5)
    axes = figure.subplots()
    axes.plot(u_mm, f, color=BEST, linestyle=(0, (5, 2)), label="grasp function")
    axes.plot(u_mm, smoothed, color=ROBUST, label=f"smoothed, $\\sigma_u$ = {sigma_mm:g} mm")
    for values, colour, marker in ((f, BEST, "s"), (smoothed, ROBUST, "o")):
        peak = int(np.argmax(values))
        axes.plot([u_mm[peak]] * 2, [0, values[peak]], color=colour, linewidth=0.8, linestyle=":")
        axes.plot(u_mm[peak], values[peak], marker, color=colour, markersize=7, label="its maximum")
    axes.set(xlabel="u (mm)", ylabel="score", ylim=(0, 1.05))
    support = u_mm[(f > 0) | (smoothed > 0.01)]
    if len(support):
        axes.set_xlim(support[0] - 10, support[-1] + 10)
    handles, labels = axes.get_legend_handles_labels()
    order = [0, 2, 1, 3]
    figure.legend([handles[i] for i in order], [labels[i] for i in order], loc="outside upper center", ncols=2)
    return figure
