"""Moving grasp functions and depth images by the motion of `transforms.T_world_scene`: the plain numpy versions.

`learning.dataset` does the same in torch, faster; a test holds the two together.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy import ndimage

from graspfn.geometry.grid import SHAPE, poses, to_index
from graspfn.geometry.transforms import unmove_pose
from graspfn.imaging.camera import Camera


def sample_function(f: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Values (...[, C]) float64 of f (33, 44, 6[, C]) at poses q (..., 3) = (u [m], v [m], theta [rad]).

    Trilinear between the centres of the cells. theta wraps at a half turn; past the outermost centres the function
    falls off to 0 within one cell, since no pose outside Q was ever attempted.
    """
    index = to_index(q)
    low = np.floor(index).astype(int)
    fraction = index - low
    total: np.ndarray = np.zeros((*index.shape[:-1], *f.shape[3:]))
    for corner in itertools.product((0, 1), repeat=3):
        v, u, theta = np.moveaxis(low + corner, -1, 0)
        weight = np.prod(np.where(corner, fraction, 1 - fraction), axis=-1)
        inside = (v >= 0) & (v < SHAPE[0]) & (u >= 0) & (u < SHAPE[1])
        weight = np.where(inside, weight, 0.0).reshape(inside.shape + (1,) * (f.ndim - 3))
        total += weight * f[v.clip(0, SHAPE[0] - 1), u.clip(0, SHAPE[1] - 1), theta % SHAPE[2]]
    return total


def move_function(f: np.ndarray, shift_uv: np.ndarray, theta: float) -> np.ndarray:
    """The grasp function (33, 44, 6[, C]) float64 of the object of f (same shape) after it has been moved.

    moved(move_pose(q)) == f(q): what was a good grasp is one still, at the pose that went with the object.
    """
    return sample_function(f, unmove_pose(poses(), shift_uv, theta))


def move_image(depth: np.ndarray, shift_uv: np.ndarray, theta: float, camera: Camera, fill: float) -> np.ndarray:
    """depth: (height, width), metres -> the same shape and dtype, turned about the image centre and then shifted.

    Bilinear; `fill` (the depth of the bare table) enters from outside. The turn is what a camera would see exactly. The
    shift moves every pixel as if it lay on the table, as the paper does: a real one would move high points further.
    """
    y, x = np.mgrid[: camera.height, : camera.width]
    uv = camera.pixel_to_table(np.stack([x, y], axis=-1))
    came_from = unmove_pose(np.concatenate([uv, np.zeros_like(uv[..., :1])], axis=-1), shift_uv, theta)[..., :2]
    pixel = camera.table_to_pixel(came_from)
    return ndimage.map_coordinates(depth, [pixel[..., 1], pixel[..., 0]], order=1, mode="grid-constant", cval=fill)
