"""Training samples, made while training: each is a pure function of one line of the augmentation table.

The same motion and noise as `imaging.warp` and `imaging.noise`, in one pass: the jitter of eq. 2 is added to the
coordinates at which the moved image is read, so that the image is interpolated once.
"""

from __future__ import annotations

import hashlib

import numpy as np
import pandas as pd
import torch
from torch.nn import functional
from torch.utils.data import Dataset

from graspfn.geometry.grid import CELL_RAD, SHAPE, axes
from graspfn.imaging.camera import Camera
from graspfn.imaging.network_input import CROP_SHAPE, UNIT_M, area_average, crop_slices
from graspfn.params import Noise

CLASSES = 6  # scores 0, 0.2, ..., 1


def _read_at(planes: torch.Tensor, x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    """planes: (C, H, W) -> (C, h, w), bilinear at pixel coordinates x, y (h, w), 0 outside."""
    height, width = planes.shape[-2:]
    grid = torch.stack([x * (2 / (width - 1)) - 1, y * (2 / (height - 1)) - 1], dim=-1)
    return functional.grid_sample(planes[None], grid[None], padding_mode="zeros", align_corners=True)[0]


def _origins(x: torch.Tensor, y: torch.Tensor, shift: np.ndarray, theta: float) -> tuple[torch.Tensor, torch.Tensor]:
    """Where points (x, y), from the image centre, were before the motion of `T_world_scene`; all in one unit."""
    c, s = float(np.cos(theta)), float(np.sin(theta))
    du, dv = float(shift[0]), float(shift[1])
    return x * c + y * s - (c * du + s * dv), y * c - x * s + (s * du - c * dv)


class SampleImages:
    """Network inputs (1, 132, 176) float32 of the lines of an augmentation table.

    images: (N, 480, 640) float32, metres, noise-free, one object in the centre of each; may be a memory map.
    """

    def __init__(self, images: np.ndarray, table: pd.DataFrame, camera: Camera, noise: Noise):
        self.images, self.camera, self.noise = images, camera, noise
        self.rows = table["row"].to_numpy()
        self.shifts = table[["shift_u_m", "shift_v_m"]].to_numpy(dtype=float)
        self.theta = table["theta_rad"].to_numpy(dtype=float)
        self.noise_seeds = table["noise_seed"].to_numpy()
        crop_slices(camera)  # refuses images that Q does not fit into
        rows, columns = CROP_SHAPE
        self.x = torch.arange(columns, dtype=torch.float32)[None, :] - (columns - 1) / 2
        self.y = torch.arange(rows, dtype=torch.float32)[:, None] - (rows - 1) / 2

    def __len__(self) -> int:
        return len(self.rows)

    def image(self, index: int) -> torch.Tensor:
        draws = np.random.default_rng(self.noise_seeds[index]).standard_normal((3, *CROP_SHAPE), dtype=np.float32)
        jitter_y, jitter_x, error = torch.from_numpy(draws)
        x, y = jitter_x.mul_(self.noise.sigma_p_px).add_(self.x), jitter_y.mul_(self.noise.sigma_p_px).add_(self.y)
        shift_px = self.camera.table_to_pixel(self.shifts[index]) - self.camera.centre
        x, y = _origins(x, y, shift_px, self.theta[index])
        # Heights, so that what enters from outside the image (0) is table.
        depth = np.array(self.images[self.rows[index]], dtype=np.float32)
        height = torch.from_numpy(np.float32(self.camera.table_depth) - depth)[None]
        cx, cy = (float(c) for c in self.camera.centre)
        moved = _read_at(height, x + cx, y + cy)[0] - error.mul_(self.noise.sigma_d_mm / 1000)
        return torch.from_numpy(area_average(moved.numpy()) * np.float32(1 / UNIT_M))[None]

    def hashed(self, *arrays: np.ndarray) -> str:
        """A digest of the table, the images and `arrays`, to tell whether a checkpoint was made from the same."""
        digest = hashlib.sha256(repr((self.camera, self.noise, self.images.shape)).encode())
        for array in (self.rows, self.shifts, self.theta, self.noise_seeds, self.images, *arrays):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def move_label(f: torch.Tensor, shift_uv: np.ndarray, theta: float) -> torch.Tensor:
    """f: (6, 33, 44) float32, axes (theta, v, u) -> the same, as `imaging.warp.move_function` moves it.

    A turn offsets theta by the same fraction of a cell everywhere, so that trilinear interpolation is a blend of two
    rolled copies and then one bilinear reading.
    """
    cells = theta / CELL_RAD
    whole = int(np.ceil(cells))
    upper = whole - cells
    blend = (1 - upper) * torch.roll(f, whole, dims=0) + upper * torch.roll(f, whole - 1, dims=0)
    v, u, _ = axes()
    step = u[1] - u[0]
    x, y = _origins(
        torch.from_numpy((u / step).astype(np.float32))[None, :],
        torch.from_numpy((v / step).astype(np.float32))[:, None],
        np.asarray(shift_uv) / step,
        theta,
    )
    return _read_at(blend, x + (SHAPE[1] - 1) / 2, y + (SHAPE[0] - 1) / 2)


class GraspSamples(SampleImages, Dataset):
    """(input (1, 132, 176) float32, score classes (33, 44, 6) uint8) per line of the table.

    successes: (N, 33, 44, 6), out of `attempts`, of the objects of `images`. A moved label lies between the cells of
    Q; it takes the nearest of the six scores.
    """

    def __init__(
        self,
        images: np.ndarray,
        successes: np.ndarray,
        attempts: int,
        table: pd.DataFrame,
        camera: Camera,
        noise: Noise,
    ):
        super().__init__(images, table, camera, noise)
        self.successes, self.attempts = successes, attempts

    def label(self, index: int) -> torch.Tensor:
        successes = self.successes[self.rows[index]].astype(np.float32)
        f = torch.from_numpy(successes * np.float32((CLASSES - 1) / self.attempts)).permute(2, 0, 1).contiguous()
        moved = move_label(f, self.shifts[index], self.theta[index])
        return moved.add_(0.5).floor_().to(torch.uint8).permute(1, 2, 0).contiguous()

    def __getitem__(self, index: int) -> tuple[torch.Tensor, torch.Tensor]:
        return self.image(index), self.label(index)

    def class_frequencies(self) -> np.ndarray:
        """(6,) share of each score class over all poses of all objects, where they stand unmoved."""
        classes = np.floor(self.successes * ((CLASSES - 1) / self.attempts) + 0.5).astype(np.int64)
        return np.bincount(classes.ravel(), minlength=CLASSES) / classes.size

    def digest(self) -> str:
        return self.hashed(self.successes)


class ClassSamples(SampleImages, Dataset):
    """(input (1, 132, 176) float32, class index) per line of the table.

    classes: (N,) int64, of the objects of `images`.
    """

    def __init__(self, images: np.ndarray, classes: np.ndarray, table: pd.DataFrame, camera: Camera, noise: Noise):
        super().__init__(images, table, camera, noise)
        self.classes = np.asarray(classes, dtype=np.int64)

    def __getitem__(self, index: int) -> tuple[torch.Tensor, torch.Tensor]:
        return self.image(index), torch.tensor(self.classes[self.rows[index]])

    def digest(self) -> str:
        return self.hashed(self.classes)
