"""A parallel gripper: a hand moved kinematically, two fingers on revolute joints under constant torque (paper III-A).

Hand frame: x closes the jaws, z points up, the origin lies on the table below the hand's axis (the frame of
`geometry.transforms.T_world_grasp`). A finger angle is 0 when the finger hangs straight down and grows as it closes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from graspfn.params import Gripper, ParameterError


@dataclass(frozen=True)
class Kinematics:
    """Angles and heights that follow from the gripper's dimensions; metres and radians."""

    knuckle_x: float  # of each joint from the hand's axis
    length: float
    width: float
    thickness: float
    open_angle: float  # fingertips `opening` apart
    closed_angle: float  # fingertips meet
    knuckle_z: float  # joints above the table when the fingertips' lowest point is `clearance` above it
    palm_size: np.ndarray  # (3,)

    @classmethod
    def from_params(cls, gripper: Gripper) -> Kinematics:
        """Solve the hand's height so that the lowest point of the whole closing is `clearance_mm` above the table."""
        x, length, thickness = (
            gripper.knuckle_mm / 2e3,
            gripper.finger_length_mm / 1e3,
            gripper.finger_thickness_mm / 1e3,
        )
        open_angle = _angle_of_tip(x, length, thickness, gripper.opening_mm / 2e3)
        closed_angle = _angle_of_tip(x, length, thickness, 0.0)
        sweep = np.linspace(open_angle, closed_angle, 2001)
        deepest = np.max(length * np.cos(sweep) + thickness / 2 * np.abs(np.sin(sweep)))
        palm = np.array(
            [gripper.knuckle_mm + 2 * gripper.finger_thickness_mm, gripper.palm_width_mm, gripper.palm_height_mm]
        )
        return cls(
            knuckle_x=x,
            length=length,
            width=gripper.finger_width_mm / 1e3,
            thickness=thickness,
            open_angle=open_angle,
            closed_angle=closed_angle,
            knuckle_z=float(deepest) + gripper.clearance_mm / 1e3,
            palm_size=palm / 1e3,
        )

    def reach(self) -> float:
        """Farthest point of the open fingers from the hand's axis along the closing direction, metres."""
        a = self.open_angle
        tip = self.knuckle_x - self.length * np.sin(a) + self.thickness / 2 * np.cos(a)
        return float(max(tip, self.knuckle_x + self.thickness / 2))

    def parts(self, angles: tuple[float, float]) -> list[tuple[np.ndarray, np.ndarray]]:
        """Boxes of palm, left and right finger as (T_hand_box (4, 4), size (3,)) at the finger angles (left, right)."""
        palm = np.eye(4)
        palm[2, 3] = self.knuckle_z + self.palm_size[2] / 2
        boxes = [(palm, self.palm_size)]
        for side, angle in zip((-1, 1), angles, strict=True):
            c, s = np.cos(side * angle), np.sin(side * angle)
            T = np.eye(4)
            T[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
            T[:3, 3] = [side * self.knuckle_x, 0, self.knuckle_z] + T[:3, :3] @ [0, 0, -self.length / 2]
            boxes.append((T, np.array([self.thickness, self.width, self.length])))
        return boxes


def _angle_of_tip(knuckle_x: float, length: float, thickness: float, tip_x: float) -> float:
    """Finger angle at which the inner edge of the fingertip is `tip_x` from the hand's axis.

    Solves knuckle_x - thickness/2 cos(a) - length sin(a) = tip_x.
    """
    amplitude = np.hypot(length, thickness / 2)
    ratio = (knuckle_x - tip_x) / amplitude
    if abs(ratio) > 1:
        raise ParameterError("gripper.finger_length_mm: too short a finger for opening_mm and knuckle_mm")
    return float(np.arcsin(ratio) - np.arctan2(thickness / 2, length))
