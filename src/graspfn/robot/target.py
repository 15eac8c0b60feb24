"""From a gripper over the table back to a pose in the image: the inverse of `planning.target` (paper III)."""

from __future__ import annotations

import numpy as np

from graspfn.robot.trial import RecordingError

REACH_M = 5.0  # farther from the image centre no arm over the table reaches: another unit
AXES = ("x", "y", "z", "-x", "-y", "-z")
DOWN = np.diag([1.0, -1.0, -1.0, 1.0])  # a table frame whose z points into the table: x along +u, y along +v


def target_in_image(T_table_gripper: np.ndarray, closing_axis: str = "x") -> np.ndarray:
    """(3,) q (u [m], v [m], theta [rad] in [0, pi)) of a gripper over the table: the inverse of `T_world_grasp`.

    closing_axis: of the gripper's frame, along which its jaws close. RecordingError where that is no grasp from above.
    """
    closing = T_table_gripper[:3, AXES.index(closing_axis) % 3]  # either end of it is the same jaw
    if np.hypot(closing[0], closing[1]) < 0.5:
        raise RecordingError(
            f"pose whose {closing_axis} axis is more than 60 degrees off the table; the jaws close along it"
        )
    u, v = T_table_gripper[0, 3], -T_table_gripper[1, 3]
    if np.hypot(u, v) > REACH_M:
        raise RecordingError(f"pose {np.hypot(u, v):g} m from the image centre; it takes metres, on the table")
    return np.array([u, v, np.arctan2(-closing[1], closing[0]) % np.pi])
