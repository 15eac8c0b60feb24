"""From a pose in the image to one in the robot's frame, and back (paper III)."""

from __future__ import annotations

import numpy as np

from graspfn.geometry.transforms import T_world_grasp
from graspfn.robot.trial import RecordingError

REACH_M = 5.0  # farther from the image centre no arm over the table reaches: another unit
AXES = ("x", "y", "z", "-x", "-y", "-z")
DOWN = np.diag([1.0, -1.0, -1.0, 1.0])  # a table frame whose z points into the table: x along +u, y along +v


def T_robot_target(
    T_robot_gripper: np.ndarray, T_gripper_camera: np.ndarray, T_camera_table: np.ndarray, q: np.ndarray
) -> np.ndarray:
    """(4, 4) the target q (u [m], v [m], theta [rad]) of an image in the robot's frame: T_RP = T_RG T_GC T_CI p.

    T_robot_gripper: where the gripper was when the image was taken. T_camera_table: the inverse of
    `imaging.camera.Camera.T_world_camera`. A camera beside the arm has no gripper in between: T_robot_camera then
    takes the place of the first two, with the identity for the other.
    """
    return T_robot_gripper @ T_gripper_camera @ T_camera_table @ T_world_grasp(q)


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
