"""One failed trial on a page: what was seen, planned, reached, and what fingers and lift did."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from graspfn.imaging.camera import Camera
from graspfn.params import Arm
from graspfn.reporting.figures.grasp_functions import add_function, add_pose
from graspfn.reporting.figures.style import BEST, ROBUST, WIDE_IN, new_figure, scale_bar, show_depth, square, styled
from graspfn.robot.replan import Replanned
from graspfn.robot.trial import TrialRecording

HALF_MM = 120.0  # of the square of the table that is shown, about the commanded pose
MOST_JOINTS = 8  # that are drawn where nobody says which are the fingers
LETTERS = 150  # on a line of the heading


def _series(axes: Axes, trial: TrialRecording, arm: Arm) -> None:
    """Fingers on the left axis, the lift on the right, over the time since the command."""
    for name in arm.finger_joints or trial.joint_names[:MOST_JOINTS]:
        axes.plot(trial.joint_time_s, trial.joint_positions[:, trial.joint_names.index(name)], label=name, linewidth=1)
    if arm.finger_joints and arm.finger_shut is not None:
        axes.axhline(arm.finger_shut, color="0.6", linestyle=":", linewidth=1, label="where they meet")
    axes.set_xlabel("time since the command [s]")
    axes.set_ylabel("joints [rad or m]")
    if len(trial.lift_m):
        right = axes.twinx()
        right.plot(trial.lift_time_s, trial.lift_m * 1000, color="black", linestyle="--", linewidth=1)
        right.set_ylabel("gripper above the table [mm], dashed")
    if axes.lines:
        for text in axes.legend(loc="center left", fontsize=6).get_texts():
            text.set_parse_math(False)


@styled
def draw_failed_trial(
    title: str,
    trial: TrialRecording,
    arm: Arm,
    opening_mm: float,
    camera: Camera,
    replanned: Replanned | None,
    remarks: Sequence[str],
) -> Figure:
    """camera: that of the image. The commanded pose is drawn broken, the reached one whole; where a network was given,
    its function and the smoothed one stand beside, with the pose that it plans now. Holes of the image are blue."""
    figure = new_figure(WIDE_IN, 5.2)
    top, bottom = figure.subfigures(2, 1, squeeze=False)[:, 0]
    panels: list[tuple[str, np.ndarray | None]] = [("commanded (broken), reached", None)]
    if replanned is not None:
        panels += [("function, planned again", replanned.f), ("smoothed", replanned.robust)]
    window = None if trial.commanded is None else square(trial.commanded[:2] * 1000, HALF_MM, camera)
    for axes, (name, f) in zip(top.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        show_depth(axes, trial.depth, camera, window)
        axes.set_title(name)
        scale_bar(axes)
        if f is not None and replanned is not None:
            add_function(axes, f)
            add_pose(axes, replanned.q, opening_mm, "black", 1.4)
            continue
        add_pose(axes, trial.commanded, opening_mm, BEST, 1.4, linestyle=(0, (4, 1.5)))
        if trial.achieved is not None:
            add_pose(axes, trial.achieved, opening_mm, ROBUST, 1.6)
    _series(bottom.subplots(), trial, arm)
    c = trial.condition
    made = "simulated robot" if c.simulated else "real robot"
    sigma = f"Σ {c.sigma_uv_mm:g} mm, {c.sigma_theta_deg:g}°"
    tried = f"{c.object}, placement {c.placement}: {c.method} {c.network}, {sigma}"
    lines = [f"{title} ({made})", tried, trial.why, *remarks]
    heading = "\n".join(line for text in lines for line in textwrap.wrap(text, LETTERS))
    figure.suptitle(heading, fontsize=7, parse_math=False)
    return figure
