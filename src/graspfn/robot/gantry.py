"""The simulated robot's arm: a gantry above the table that carries the gripper and, beside it, the camera.

It goes from where it looks over its target, down, closes, and rises, all by its joints; the frames that TF has, and
the robot's description, follow from the same joints. Simulated: no such arm was built.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from graspfn.geometry.transforms import T_world_grasp, rotation_z, translation
from graspfn.imaging.camera import Camera
from graspfn.params import Gripper
from graspfn.physics.attempt import Frame
from graspfn.physics.gripper import Kinematics
from graspfn.robot.trial import FRAME

BASE, FLANGE, GRIPPER, CAMERA = "base_link", "flange", "gripper", "camera_depth_optical_frame"
ARM_JOINTS = ("arm_x", "arm_y", "arm_z", "arm_turn")
FINGER_JOINTS = ("finger_left", "finger_right")
JOINTS = (*ARM_JOINTS, *FINGER_JOINTS)
T_BASE_TABLE = translation(0.6, 0.1, 0.05) @ rotation_z(np.pi / 2)
T_FLANGE_CAMERA = translation(0.1, 0.0, -0.02)  # before the camera's own turn
RATE_S = 0.02  # between joint states
LOOK_S, TRAVEL_S, DOWN_S, STILL_S, END_S = 0.5, 1.0, 1.0, 0.2, 0.3
ABOVE_M = 0.2  # the target, from where the gripper goes straight down
ARRIVED_S = TRAVEL_S + DOWN_S  # after the command


@dataclass(frozen=True, eq=False)
class Joint:
    """One that slides along or turns about `axis` (3,) of its own frame, at T_parent_joint (4, 4)."""

    name: str
    parent: str
    child: str
    T_parent_joint: np.ndarray
    axis: tuple[float, float, float]
    turns: bool

    def T(self, position: float) -> np.ndarray:
        """T_parent_child (4, 4) at a position, metres or radians."""
        moved = np.eye(4)
        if self.turns:
            moved[:3, :3] = Rotation.from_rotvec(np.multiply(self.axis, position)).as_matrix()
        else:
            moved[:3, 3] = np.multiply(self.axis, position)
        return self.T_parent_joint @ moved


@dataclass(frozen=True, eq=False)
class Motion:
    """time_s (T,) since the command, positions (T, 6) of JOINTS, metres or radians."""

    time_s: np.ndarray
    positions: np.ndarray


class Gantry:
    """joints: in the order of JOINTS. fixed: (parent, child, T_parent_child), hand-eye calibration among them."""

    def __init__(self, camera: Camera, gripper: Gripper):
        self.kinematics = Kinematics.from_params(gripper)
        self._T_flange_gripper = translation(0, 0, -self.kinematics.height - self.kinematics.palm_size[2])
        T_flange_camera = T_FLANGE_CAMERA.copy()
        T_flange_camera[:3, :3] = camera.T_world_camera[:3, :3]
        self._T_base_looking = T_BASE_TABLE @ camera.T_world_camera @ np.linalg.inv(T_flange_camera)
        self.fixed = (
            (BASE, FRAME, T_BASE_TABLE),
            (FLANGE, GRIPPER, self._T_flange_gripper),
            (FLANGE, CAMERA, T_flange_camera),
        )
        here = np.eye(4)
        fingers = [
            Joint(
                name,
                GRIPPER,
                f"{name}_link",
                self.kinematics.finger(side, 0.0),
                (0.0, float(side), 0.0) if self.kinematics.turns else (-float(side), 0.0, 0.0),
                self.kinematics.turns,
            )
            for side, name in zip((-1, 1), FINGER_JOINTS, strict=True)
        ]
        self.joints = (
            Joint("arm_x", BASE, "bridge", here, (1.0, 0.0, 0.0), False),
            Joint("arm_y", "bridge", "carriage", here, (0.0, 1.0, 0.0), False),
            Joint("arm_z", "carriage", "column", here, (0.0, 0.0, 1.0), False),
            Joint("arm_turn", "column", FLANGE, here, (0.0, 0.0, 1.0), True),
            *fingers,
        )

    @staticmethod
    def _arm(T_base_flange: np.ndarray) -> np.ndarray:
        """(4,) positions of ARM_JOINTS."""
        turn = np.arctan2(T_base_flange[1, 0], T_base_flange[0, 0])
        return np.array([*T_base_flange[:3, 3], turn])

    def over(self, q: np.ndarray, rise: float) -> np.ndarray:
        """(4,) positions of ARM_JOINTS with the gripper at q (3,), so many metres above where it grasps."""
        T = T_BASE_TABLE @ T_world_grasp(q) @ translation(0, 0, rise)
        return self._arm(T @ np.linalg.inv(self._T_flange_gripper))

    def waits(self) -> Motion:
        """Where no grasp was planned: it stays where it looks from."""
        time_s = np.arange(-LOOK_S, END_S, RATE_S)
        return Motion(time_s, np.tile([*self._arm(self._T_base_looking), *self._open], (len(time_s), 1)))

    @property
    def _open(self) -> tuple[float, float]:
        return self.kinematics.open, self.kinematics.open

    def grasps(self, q: np.ndarray, stopped: float, frames: Sequence[Frame]) -> Motion:
        """The whole trial at the pose q (3,) that it reaches.

        stopped: rise at which the open gripper met the object on its way down and went no farther, metres; 0 where
        nothing was in the way. frames: of closing and rising, every 10 ms (`physics.attempt.Frame`).
        """
        above, low = self.over(q, ABOVE_M), self.over(q, stopped)
        begin = ARRIVED_S + STILL_S
        marks = [(-LOOK_S, self._arm(self._T_base_looking)), (0.0, self._arm(self._T_base_looking))]
        marks += [(TRAVEL_S, above), (ARRIVED_S, low), (begin, low)]
        time_s = np.arange(round(-LOOK_S / RATE_S), round(begin / RATE_S)) * RATE_S
        knots, arms = np.array([mark[0] for mark in marks]), np.array([mark[1] for mark in marks])
        arm = np.column_stack([_eased(time_s, knots, column) for column in arms.T])
        approach = np.column_stack([arm, np.tile(self._open, (len(time_s), 1))])
        step = max(1, round(RATE_S / (frames[1].time_s - frames[0].time_s))) if len(frames) > 1 else 1
        kept = list(frames[::step])
        acting = np.array([[*self.over(q, frame.hand_z), *frame.fingers] for frame in kept]).reshape(-1, len(JOINTS))
        times = np.concatenate([time_s, begin + np.array([frame.time_s for frame in kept])])
        positions = np.concatenate([approach, acting])
        after = np.arange(1, round(END_S / RATE_S) + 1) * RATE_S
        return Motion(
            np.concatenate([times, times[-1] + after]),
            np.concatenate([positions, np.tile(positions[-1], (len(after), 1))]),
        )

    def transforms(self, positions: np.ndarray) -> list[tuple[str, str, np.ndarray]]:
        """(parent, child, T_parent_child) of every joint at positions (6,)."""
        return [
            (joint.parent, joint.child, joint.T(float(position)))
            for joint, position in zip(self.joints, positions, strict=True)
        ]

    def urdf(self) -> str:
        """The robot's description, which says that it is simulated."""
        palm, left, right = (size for _, size in self.kinematics.parts(self._open))
        middle = translation(0, 0, self.kinematics.height + palm[2] / 2)
        hanging = translation(0, 0, -self.kinematics.length / 2)
        boxes = {GRIPPER: (middle, palm), "finger_left_link": (hanging, left), "finger_right_link": (hanging, right)}
        links = [BASE, FRAME, CAMERA, GRIPPER, *(joint.child for joint in self.joints)]
        lines = [
            '<?xml version="1.0"?>',
            '<robot name="simulated_gantry">',
            "<!-- Simulated: no such arm was built. -->",
        ]
        lines += [
            f'<link name="{name}">{_box(*boxes[name])}</link>' if name in boxes else f'<link name="{name}"/>'
            for name in links
        ]
        for parent, child, T in self.fixed:
            lines.append(f'<joint name="{child}_mount" type="fixed">{_ends(parent, child, T)}</joint>')
        effort, speed = self.kinematics.effort, self.kinematics.speed
        for joint in self.joints:
            low, high = (self.kinematics.open, self.kinematics.closed) if joint.name in FINGER_JOINTS else (-4.0, 4.0)
            lines.append(
                f'<joint name="{joint.name}" type="{"revolute" if joint.turns else "prismatic"}">'
                f"{_ends(joint.parent, joint.child, joint.T_parent_joint)}"
                f'<axis xyz="{_numbers(joint.axis)}"/>'
                f'<limit lower="{low:.6g}" upper="{high:.6g}" effort="{effort:g}" velocity="{speed:g}"/></joint>'
            )
        return "\n".join([*lines, "</robot>", ""])


def _eased(time_s: np.ndarray, knots: np.ndarray, values: np.ndarray) -> np.ndarray:
    """From value to value, at rest at every knot."""
    i = np.clip(np.searchsorted(knots, time_s, side="right") - 1, 0, len(knots) - 2)
    share = np.clip((time_s - knots[i]) / (knots[i + 1] - knots[i]), 0, 1)
    return values[i] + (values[i + 1] - values[i]) * (1 - np.cos(np.pi * share)) / 2


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(f"{value + 0.0:.6g}" for value in values)


def _origin(T: np.ndarray) -> str:
    turn = Rotation.from_matrix(T[:3, :3]).as_euler("xyz")
    return f'<origin xyz="{_numbers(T[:3, 3])}" rpy="{_numbers(np.round(turn, 9))}"/>'


def _ends(parent: str, child: str, T: np.ndarray) -> str:
    return f'<parent link="{parent}"/><child link="{child}"/>{_origin(T)}'


def _box(T: np.ndarray, size: np.ndarray) -> str:
    return f'<visual>{_origin(T)}<geometry><box size="{_numbers(size)}"/></geometry></visual>'
