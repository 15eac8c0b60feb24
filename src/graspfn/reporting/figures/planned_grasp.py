"""Figure of one planned grasp: where it is in the image, and the grasp function that it was planned on."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Ellipse

from graspfn.geometry.transforms import T_world_grasp, apply
from graspfn.imaging.height_map import CELL_M, SHAPE, TABLE_M
from graspfn.planning.methods import best_grasp
from graspfn.planning.planner import Grasp, NoGrasp
from graspfn.reporting.figures.grasp_functions import add_function, add_pose
from graspfn.reporting.figures.style import BEST, DARKEST_M, ROBUST, WIDE_IN, bare, new_figure, scale_bar, styled

HALF_MM = 1000 * CELL_M * np.array(SHAPE[::-1]) / 2
MARGIN_MM = 50.0
SPREAD = 2.0  # standard deviations that the ellipse and the arc span


@styled
def draw_planned_grasp(depth: np.ndarray, found: Grasp | NoGrasp, opening_mm: float, name: str) -> Figure:
    """depth: (height, width), metres, NaN where nothing was measured; opening_mm: between the open fingers."""
    figure = new_figure(WIDE_IN, 3.6)
    if isinstance(found, NoGrasp):
        image = figure.subplots()
        _show_image(image, depth, None)
        image.set_title(f"{name}: no grasp", parse_math=False)
        image.set_xlabel(found.reason, parse_math=False, wrap=True)
        return figure
    image, table = figure.subplots(1, 2, width_ratios=[4 / 3, 1])
    _show_image(image, depth, found.camera.deproject(depth)[..., 2])
    half = opening_mm / 2000
    jaws = np.array([[-half, 0, found.z_m], [half, 0, found.z_m]])
    ends = found.camera.project(apply(T_world_grasp(found.q), jaws))[:, :2]
    image.plot(*ends.T, color=ROBUST, marker="s", markersize=4)
    image.set_title(name, parse_math=False)
    _show_table(table, found, opening_mm)
    told = f"{found.method}: promises {found.robust_score:.2f}, without errors {found.score:.2f}"
    table.set_title(told)
    u, v, theta = found.q
    numbers = f"u = {1000 * u:.1f} mm, v = {1000 * v:.1f} mm, $\\theta$ = {np.degrees(theta):.1f}°"
    table.set_xlabel(f"{numbers}\nred: {found.method}, blue: best; ellipse and arcs: {SPREAD:g} $\\sigma$")
    return figure


def _show_image(axes: Axes, depth: np.ndarray, heights: np.ndarray | None) -> None:
    if heights is None:
        low, high = np.nanpercentile(depth, [2, 98])
        grey = np.clip((depth - low) / max(high - low, 1e-6), 0, 1) * 0.6 + 0.35
    else:
        grey = _greys(heights)
    rgb = np.repeat(grey[..., None], 3, axis=-1)
    rgb[~np.isfinite(grey)] = (0.10, 0.20, 0.50)
    axes.imshow(rgb, interpolation="nearest")
    bare(axes)


def _greys(heights: np.ndarray) -> np.ndarray:
    """Dark where high, as depth images are shown elsewhere."""
    return np.clip(0.95 - 0.62 * np.sign(heights) * np.sqrt(np.abs(heights) / DARKEST_M), 0.33, 1.0)


def _show_table(axes: Axes, found: Grasp, opening_mm: float) -> None:
    rgb = np.repeat(_greys(found.seen.heights)[..., None], 3, axis=-1)
    rgb[~found.seen.seen] = (0.10, 0.20, 0.50)
    (u, v), (q_u, q_v) = HALF_MM, 1000 * found.q[:2]
    axes.imshow(rgb, extent=(-u, u, v, -v), interpolation="nearest")
    add_function(axes, found.function.f, thickest_pt=1.2)
    add_pose(axes, best_grasp(found.function.f), opening_mm, BEST, 1.4, linestyle=(0, (4, 1.5)))
    add_pose(axes, found.q, opening_mm, ROBUST)
    covariance = found.function.uncertainty.covariance_at(found.q)
    variances, directions = np.linalg.eigh(covariance[:2, :2])
    across = 2000 * SPREAD * np.sqrt(variances.clip(0))
    angle = float(np.degrees(np.arctan2(directions[1, 0], directions[0, 0])))
    axes.add_patch(Ellipse((q_u, q_v), *across, angle=angle, fill=False, color=ROBUST, linewidth=0.9))
    theta, spread = np.degrees(found.q[2]), min(90.0, SPREAD * float(np.degrees(np.sqrt(covariance[2, 2]))))
    for side in (theta, theta + 180):
        arc = Arc((q_u, q_v), opening_mm, opening_mm, theta1=side - spread, theta2=side + spread, color=ROBUST)
        axes.add_patch(arc)
    rows, columns = np.nonzero(found.seen.heights >= TABLE_M)
    corners = 1000 * CELL_M * (np.stack([columns, rows], axis=-1) + 0.5) - HALF_MM
    reach = max(float(np.ptp(corners, axis=0).max()) / 2 if len(corners) else 0.0, opening_mm / 2) + MARGIN_MM
    reach = min(reach, float(HALF_MM[1]))
    low_u, low_v = np.clip([q_u - reach, q_v - reach], -HALF_MM, HALF_MM - 2 * reach)
    axes.set_xlim(low_u, low_u + 2 * reach)
    axes.set_ylim(low_v + 2 * reach, low_v)
    scale_bar(axes)
    bare(axes)
