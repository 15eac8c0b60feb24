"""One failed trial on a page: what was seen, planned, reached, and what fingers and lift did."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from graspfn.imaging.camera import Camera
from graspfn.imaging.holes import fill_holes
from graspfn.reporting.figures.grasp_functions import add_function, add_pose
from graspfn.reporting.figures.style import BEST, ROBUST, WIDE_IN, new_figure, scale_bar, show_depth, styled
from graspfn.robot.replan import Replanned
from graspfn.robot.trial import TrialRecording


def _series(axes: Axes, trial: TrialRecording, fingers: tuple[str, ...]) -> None:
    """Fingers on the left axis, the lift on the right, over the time since the command."""
    shown = fingers or trial.joint_names
    for name in shown:
        axes.plot(trial.joint_time_s, trial.joint_positions[:, trial.joint_names.index(name)], label=name, linewidth=1)
    axes.set_xlabel("time since the command [s]")
    axes.set_ylabel("joints [rad or m]")
    if len(trial.lift_m):
        right = axes.twinx()
        right.plot(trial.lift_time_s, trial.lift_m * 1000, color="black", linestyle="--", linewidth=1, label="lift")
        right.set_ylabel("gripper above the table [mm], dashed")
    if shown:
        axes.legend(loc="upper left", fontsize=6)


@styled
def draw_failed_trial(
    title: str,
    trial: TrialRecording,
    fingers: tuple[str, ...],
    opening_mm: float,
    camera: Camera,
    replanned: Replanned | None,
    remarks: str,
) -> Figure:
    """camera: that of the image. The commanded pose is drawn broken, the reached one whole; where a network was given,
    its function and the smoothed one stand beside, with the pose that it plans now."""
    figure = new_figure(WIDE_IN, 5.2)
    top, bottom = figure.subfigures(2, 1, squeeze=False)[:, 0]
    filled = fill_holes(trial.depth, None)
    panels: list[tuple[str, np.ndarray | None]] = [("commanded (broken), reached", None)]
    if replanned is not None:
        panels += [("function, planned again", replanned.f), ("smoothed", replanned.robust)]
    for axes, (name, f) in zip(top.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        show_depth(axes, filled, camera)
        axes.set_title(name)
        scale_bar(axes, 100)
        if f is not None and replanned is not None:
            add_function(axes, f)
            add_pose(axes, replanned.q, opening_mm, "black", 1.4)
            continue
        add_pose(axes, trial.commanded, opening_mm, BEST, 1.4, linestyle=(0, (4, 1.5)))
        if trial.achieved is not None:
            add_pose(axes, trial.achieved, opening_mm, ROBUST, 1.6)
    _series(bottom.subplots(), trial, fingers)
    c = trial.condition
    made = "simulated robot" if c.simulated else "real robot"
    tried = (
        f"{c.object}, placement {c.placement}: {c.method} {c.network}, Σ {c.sigma_uv_mm:g} mm, {c.sigma_theta_deg:g}°"
    )
    figure.suptitle("\n".join(filter(None, [f"{title} ({made})", tried, remarks])), fontsize=7)
    return figure
