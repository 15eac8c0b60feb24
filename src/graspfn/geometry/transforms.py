"""Rigid transforms, (4, 4) float64 arrays named T_a_b: they take coordinates in frame b to frame a.

World: x is the image's +u, y is the image's -v, z points up, the table is z = 0 and the image centre is over the
origin. Camera: x = +u, y = +v, z along the viewing direction (down).
"""

from __future__ import annotations

import numpy as np


def rotation_z(angle: float) -> np.ndarray:
    """(4, 4) turn about z by `angle` radians, counter-clockwise seen from above."""
    c, s = np.cos(angle), np.sin(angle)
    T = np.eye(4)
    T[:2, :2] = [[c, -s], [s, c]]
    return T


def translation(x: float, y: float, z: float = 0.0) -> np.ndarray:
    """(4, 4) translation in metres."""
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def T_world_grasp(q: np.ndarray) -> np.ndarray:
    """(4, 4) frame of gripper pose q = (u, v, theta) on the table: x closes the jaws, z points up."""
    u, v, theta = np.asarray(q, dtype=float)
    return translation(u, -v) @ rotation_z(-theta)


def T_world_scene(shift_uv: np.ndarray, theta: float) -> np.ndarray:
    """(4, 4) motion of what is on the table: a turn by theta (from +u towards +v), then a shift by (u, v) metres."""
    return translation(shift_uv[0], -shift_uv[1]) @ rotation_z(-theta)


def move_pose(q: np.ndarray, shift_uv: np.ndarray, theta: float) -> np.ndarray:
    """Poses (..., 3) after the motion of `T_world_scene`: there they meet the moved object as q met the object."""
    q = np.asarray(q, dtype=float)
    c, s = np.cos(theta), np.sin(theta)
    u = c * q[..., 0] - s * q[..., 1] + shift_uv[0]
    v = s * q[..., 0] + c * q[..., 1] + shift_uv[1]
    return np.stack([u, v, (q[..., 2] + theta) % np.pi], axis=-1)


def unmove_pose(q: np.ndarray, shift_uv: np.ndarray, theta: float) -> np.ndarray:
    """Inverse of `move_pose`."""
    back = np.asarray(q, dtype=float) - [shift_uv[0], shift_uv[1], 0.0]
    return move_pose(back, np.zeros(2), -theta)


def apply(T: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (..., 3) taken through T (4, 4)."""
    return points @ T[:3, :3].T + T[:3, 3]
