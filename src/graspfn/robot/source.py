"""Whose recordings the workflow reads: where they lie, and how they tell where the gripper was."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from graspfn.params import Arm, Gripper, Robot
from graspfn.physics.gripper import Kinematics
from graspfn.robot.gantry import FINGER_JOINTS
from graspfn.robot.read import ARM

RECORDINGS = Path("data/recordings")  # of the simulated robot


def source_of(robot: Robot, arm: Arm, gripper: Gripper) -> tuple[Path, Arm]:
    """The user's bags where they are, read as `arm` says; or those of the simulated robot and its gantry."""
    if robot.source == "folder":
        return Path(robot.folder), arm
    closed = Kinematics.from_params(gripper).closed
    return RECORDINGS, dataclasses.replace(ARM, finger_joints=FINGER_JOINTS, finger_shut=closed)
