"""The pose grid Q (paper III): 44 x 33 x 6 = 8712 gripper poses q = (u, v, theta).

A pose is an array (..., 3) of (u [m], v [m], theta [rad]): u along the image's +x, v along the image's +y (down),
both from the image centre and measured on the table; theta is the direction in which the jaws close, from +u
towards +v. A parallel jaw is symmetric under a half turn, so theta lives on [0, pi) and wraps there.
A grasp function is an array (33, 44, 6) with axes (v, u, theta), so that f[:, :, k] lies on the image as it is seen.
"""

from __future__ import annotations

import numpy as np

SHAPE = (33, 44, 6)  # v, u, theta
CELL_M = 0.010
CELL_PX = 14
CELL_RAD = np.pi / 6


def axes() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres of the cells along v (33,), u (44,) in metres and theta (6,) in radians."""
    n_v, n_u, n_theta = SHAPE
    v = (np.arange(n_v) - (n_v - 1) / 2) * CELL_M
    u = (np.arange(n_u) - (n_u - 1) / 2) * CELL_M
    return v, u, np.arange(n_theta) * CELL_RAD


def poses() -> np.ndarray:
    """Every pose of Q: (33, 44, 6, 3) float64, (u [m], v [m], theta [rad])."""
    v, u, theta = np.meshgrid(*axes(), indexing="ij")
    return np.stack([u, v, theta], axis=-1)


def to_index(q: np.ndarray) -> np.ndarray:
    """Grid coordinates (..., 3) in (v, u, theta) of poses (..., 3) in (u, v, theta); inverse of `from_index`."""
    q = np.asarray(q, dtype=float)
    n_v, n_u, _ = SHAPE
    return np.stack(
        [q[..., 1] / CELL_M + (n_v - 1) / 2, q[..., 0] / CELL_M + (n_u - 1) / 2, q[..., 2] / CELL_RAD], axis=-1
    )


def from_index(index: np.ndarray) -> np.ndarray:
    """Poses (..., 3) in (u [m], v [m], theta [rad]) of continuous grid coordinates (..., 3) in (v, u, theta)."""
    index = np.asarray(index, dtype=float)
    n_v, n_u, _ = SHAPE
    return np.stack(
        [
            (index[..., 1] - (n_u - 1) / 2) * CELL_M,
            (index[..., 0] - (n_v - 1) / 2) * CELL_M,
            index[..., 2] * CELL_RAD,
        ],
        axis=-1,
    )


def sample_cells(attempts: int, rng: np.random.Generator) -> np.ndarray:
    """Uniform draws inside every pose's cell (paper IV-C): (33, 44, 6, attempts, 3) in (u [m], v [m], theta [rad]).

    They follow from the generator's raw bits, which numpy promises never to change: a seed tells them for good.
    """
    shape = (*SHAPE, attempts, 3)
    bits = rng.bit_generator.random_raw(int(np.prod(shape))).reshape(shape)
    offset = (bits >> np.uint64(11)) * 2.0**-53 - 0.5
    return poses()[..., None, :] + offset * [CELL_M, CELL_M, CELL_RAD]


def angle_difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Smallest signed a - b (rad) of two jaw directions, in [-pi/2, pi/2): theta wraps at a half turn."""
    return (np.asarray(a) - np.asarray(b) + np.pi / 2) % np.pi - np.pi / 2
