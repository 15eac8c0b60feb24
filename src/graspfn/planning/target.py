"""From a pose in the image to one in the robot's frame (paper III)."""

from __future__ import annotations

import numpy as np

from graspfn.geometry.transforms import T_world_grasp, translation


def T_robot_target(
    T_robot_gripper: np.ndarray, T_gripper_camera: np.ndarray, T_camera_table: np.ndarray, q: np.ndarray, z_m: float = 0
) -> np.ndarray:
    """(4, 4) the target q (u [m], v [m], theta [rad]) of an image in the robot's frame: T_RP = T_RG T_GC T_CI p.

    T_robot_gripper: where the gripper was when the image was taken. T_camera_table: the inverse of
    `imaging.camera.Camera.T_world_camera`. A camera beside the arm has no gripper in between: T_robot_camera then
    takes the place of the first two, with the identity for the other. z_m: of the target above the table.
    """
    return T_robot_gripper @ T_gripper_camera @ T_camera_table @ translation(0, 0, z_m) @ T_world_grasp(q)
