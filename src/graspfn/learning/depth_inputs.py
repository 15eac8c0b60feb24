"""Inputs for networks with input: depth, the paper's, made while training: moved depth images with the noise of eq. 2.

The same motion and noise as `imaging.warp` and `imaging.noise`, in one pass: the jitter of eq. 2 is added to the
coordinates at which the moved image is read, so that the image is interpolated once.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
import torch
from torch.nn import functional

from graspfn.geometry.grid import CELL_M, CELL_PX
from graspfn.imaging.camera import Camera
from graspfn.imaging.network_input import CROP_SHAPE, UNIT_M, area_average, crop_slices
from graspfn.learning.motions import Motions
from graspfn.params import Noise


class DepthInputs:
    """(B, 1, 132, 176) float32 of the lines of an augmentation table, heights in 0.1 m.

    images: (N, 480, 640) float32, metres, noise-free, one object in the centre of each; may be a memory map.
    """

    def __init__(self, images: np.ndarray, table: pd.DataFrame, camera: Camera, noise: Noise):
        self.images, self.camera, self.noise = images, camera, noise
        self.rows, self.motions = table["row"].to_numpy(), Motions.of(table)
        self.noise_seeds = table["noise_seed"].to_numpy()
        crop_slices(camera)  # refuses images that Q does not fit into
        rows, columns = CROP_SHAPE
        self.x = torch.arange(columns, dtype=torch.float32)[None, :] - (columns - 1) / 2
        self.y = torch.arange(rows, dtype=torch.float32)[:, None] - (rows - 1) / 2

    def image(self, index: int) -> torch.Tensor:
        draws = np.random.default_rng(self.noise_seeds[index]).standard_normal((3, *CROP_SHAPE), dtype=np.float32)
        jitter_y, jitter_x, error = torch.from_numpy(draws)
        x, y = jitter_x.mul_(self.noise.sigma_p_px).add_(self.x), jitter_y.mul_(self.noise.sigma_p_px).add_(self.y)
        motion = self.motions[[index]]
        x, y = motion.origins(x, y, CELL_M / CELL_PX)
        # Heights, so that what enters from outside the image (0) is table.
        depth = np.array(self.images[self.rows[index]], dtype=np.float32)
        height = torch.from_numpy(np.float32(self.camera.table_depth) - depth)
        grid = torch.stack([x * (2 / (height.shape[1] - 1)), y * (2 / (height.shape[0] - 1))], dim=-1)
        moved = functional.grid_sample(height[None, None], grid, padding_mode="zeros", align_corners=True)[0, 0]
        moved = motion.finish(moved[None], moved[None].flip(1)) - error.mul_(self.noise.sigma_d_mm / 1000)
        return torch.from_numpy(area_average(moved.numpy()) * np.float32(1 / UNIT_M))

    def batch(self, indices: list[int]) -> torch.Tensor:
        return torch.stack([self.image(index) for index in indices])

    def settings(self) -> object:
        """What a digest is made of, beside the table and the images."""
        return self.camera, self.noise

    def source(self) -> np.ndarray:
        """The images."""
        return self.images
