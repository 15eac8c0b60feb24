"""A hand moved kinematically and two fingers under constant torque or force (paper IV-A): where its parts are.

Hand frame: x closes the jaws, z points up, the origin lies on the table below the hand's axis (the frame of
`geometry.transforms.T_world_grasp`). Sides are -1 (left) and 1 (right). The position of a finger's joint, radians or
metres, grows as the finger closes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from graspfn.geometry.transforms import translation
from graspfn.params import Gripper, ParameterError, PrismaticGripper, RevoluteGripper

START_S = 0.02  # in which a drive reaches its speed


class Kinematics(ABC):
    """What the world needs to know of a gripper, whatever joints its fingers have. SI units."""

    turns: bool  # whether joint positions are angles
    open: float  # position of the joints with the fingertips `opening_mm` apart
    closed: float  # and where the fingertips meet
    height: float  # of joints and palm's underside, so that the fingertips' lowest point is `clearance_mm` high
    effort: float  # closing torque or force on each finger
    friction: float  # of each drive, in the unit of the effort
    speed: float  # of the joints, the most that the drives allow
    arm: float  # metres that a fingertip moves by as its joint moves by one
    acceleration: float  # likewise
    inertia: float  # of a finger: a moment or a mass

    def __init__(self, gripper: Gripper):
        self.length = gripper.finger_length_mm / 1e3
        self.width = gripper.finger_width_mm / 1e3
        self.clearance = gripper.clearance_mm / 1e3
        self.thickness = gripper.finger_thickness_mm / 1e3
        self.palm_size = np.array([gripper.palm_length_mm, gripper.palm_width_mm, gripper.palm_height_mm]) / 1e3

    @staticmethod
    def from_params(gripper: Gripper) -> Kinematics:
        """The kinematics of the gripper's joints; ParameterError where its dimensions allow none."""
        if isinstance(gripper, PrismaticGripper):
            return Prismatic(gripper)
        assert isinstance(gripper, RevoluteGripper)
        return Revolute(gripper)

    @abstractmethod
    def finger(self, side: int, position: float) -> np.ndarray:
        """T_hand_finger (4, 4): origin in the joint, the finger hanging along -z."""

    @abstractmethod
    def reach(self) -> float:
        """Farthest point of the open fingers from the hand's axis along the closing direction, metres."""

    @abstractmethod
    def gap(self) -> tuple[float, float]:
        """Distance between the inner faces of the open fingers at the table, metres, and by how much each of them leans
        inwards in a metre of height."""

    def parts(self, positions: tuple[float, float]) -> list[tuple[np.ndarray, np.ndarray]]:
        """Boxes of palm, left and right finger as (T_hand_box (4, 4), size (3,)) at joint positions (left, right)."""
        size = np.array([self.thickness, self.width, self.length])
        boxes = [(translation(0, 0, self.height + self.palm_size[2] / 2), self.palm_size)]
        for side, position in zip((-1, 1), positions, strict=True):
            boxes.append((self.finger(side, position) @ translation(0, 0, -self.length / 2), size))
        return boxes


class Revolute(Kinematics):
    """Fingers that turn about their joints; they hang straight down at position 0."""

    turns = True

    def __init__(self, gripper: RevoluteGripper):
        super().__init__(gripper)
        self.joint_x = gripper.knuckle_mm / 2e3
        self.open = self._angle_of_tip(gripper.opening_mm / 2e3)
        self.closed = self._angle_of_tip(0.0)
        sweep = np.linspace(self.open, self.closed, 2001)
        deepest = np.max(self.length * np.cos(sweep) + self.thickness / 2 * np.abs(np.sin(sweep)))
        self.height = float(deepest) + gripper.clearance_mm / 1e3
        self.effort, self.friction = gripper.torque_nm, gripper.gear_friction_nm
        self.speed, self.arm = gripper.closing_speed_rads, self.length
        self.acceleration = self.speed / START_S
        self.inertia = gripper.finger_inertia_kgm2

    def _angle_of_tip(self, tip_x: float) -> float:
        """Angle at which the inner edge of the fingertip is `tip_x` from the hand's axis.

        Solves joint_x - thickness/2 cos(a) - length sin(a) = tip_x.
        """
        amplitude = np.hypot(self.length, self.thickness / 2)
        ratio = (self.joint_x - tip_x) / amplitude
        if abs(ratio) > 1:
            raise ParameterError("gripper.finger_length_mm: too short a finger for opening_mm and knuckle_mm")
        return float(np.arcsin(ratio) - np.arctan2(self.thickness / 2, self.length))

    def finger(self, side: int, position: float) -> np.ndarray:
        c, s = np.cos(side * position), np.sin(side * position)
        T = translation(side * self.joint_x, 0, self.height)
        T[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
        return T

    def reach(self) -> float:
        tip = self.joint_x - self.length * np.sin(self.open) + self.thickness / 2 * np.cos(self.open)
        return float(max(tip, self.joint_x + self.thickness / 2))

    def gap(self) -> tuple[float, float]:
        lean = np.tan(self.open)  # negative: open fingers lean outwards going down
        face = self.joint_x - self.thickness / 2 / np.cos(self.open)  # at the height of the joints
        return float(2 * (face - lean * self.height)), float(-lean)


class Prismatic(Kinematics):
    """Fingers that slide along the closing direction, their pads always parallel: open at position 0."""

    turns = False

    def __init__(self, gripper: PrismaticGripper):
        super().__init__(gripper)
        self.open, self.closed = 0.0, gripper.opening_mm / 2e3
        self.height = self.length + gripper.clearance_mm / 1e3
        self.effort, self.friction = gripper.force_n, gripper.drive_friction_n
        self.speed, self.arm = gripper.closing_speed_mms / 1e3, 1.0
        self.acceleration = self.speed / START_S
        self.inertia = gripper.finger_mass_kg

    def finger(self, side: int, position: float) -> np.ndarray:
        return translation(side * (self.closed - position + self.thickness / 2), 0, self.height)

    def reach(self) -> float:
        return self.closed + self.thickness

    def gap(self) -> tuple[float, float]:
        return 2 * self.closed, 0.0
