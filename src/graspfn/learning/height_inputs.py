"""Inputs for networks with input: height_map, made while training: moved height maps as a depth camera measures them.

Whole batches at once, on the device that trains. The motion is exact, as a map from straight above has no parallax.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
import torch

from graspfn.imaging.height_map import BAND_M, TABLE_M
from graspfn.imaging.network_input import INPUT_SHAPE, UNIT_M
from graspfn.imaging.orthographic import FINE_M, FINE_SHAPE
from graspfn.learning.draws import triangular4
from graspfn.learning.motions import Motions
from graspfn.learning.sensor import View, read_at, sense
from graspfn.params import Noise


def cells(quarters: torch.Tensor) -> torch.Tensor:
    """(B, 4, 132, 176) -> (B, 132, 176): as `imaging.height_map` sums up what is in a cell, its top."""
    near = (quarters >= quarters.amax(dim=1, keepdim=True) - BAND_M).to(torch.float32)
    return (quarters * near).sum(dim=1) / near.sum(dim=1)


class HeightInputs:
    """(B, 2, 132, 176) float32 of the lines of an augmentation table: heights in 0.1 m, and 1 where any were seen.

    maps: (N, 264, 352) float32, of `imaging.orthographic`, one object in the centre of each; may be a memory map.
    """

    def __init__(self, maps: np.ndarray, table: pd.DataFrame, view: View, noise: Noise):
        self.maps: np.ndarray | torch.Tensor = maps
        self.view, self.noise = view, noise
        self.rows, self.motions = table["row"].to_numpy(), Motions.of(table)
        self.seeds = torch.from_numpy(table["noise_seed"].to_numpy().astype(np.int64))
        # Fine cells quarter by quarter: (528, 176) each, the first 132 rows those of the upper left ones.
        v, u = (torch.arange(n, dtype=torch.float32).view(-1, 2).T - (n - 1) / 2 for n in FINE_SHAPE)
        self.u = u[None, :, None].expand(2, 2, *INPUT_SHAPE).reshape(-1, INPUT_SHAPE[1]).contiguous()
        self.v = v[:, None, :, None].expand(2, 2, *INPUT_SHAPE).reshape(-1, INPUT_SHAPE[1]).contiguous()

    def to(self, device: torch.device) -> None:
        """Batches are made there from now on."""
        self.maps = torch.from_numpy(np.array(self.maps)).to(device)
        self.u, self.v = self.u.to(device), self.v.to(device)

    def moved(self, indices: list[int]) -> torch.Tensor:
        """(B, 132, 176) true heights after the motion, metres, of pixels read askew as eq. 2 says."""
        rows = self.rows[indices]
        maps = torch.from_numpy(self.maps[rows]) if isinstance(self.maps, np.ndarray) else self.maps[rows]
        u, v = self.u, self.v
        if self.noise.sigma_p_px:
            seeds = self.seeds[indices].to(maps.device)
            askew = triangular4(seeds, "pixels", 2, *INPUT_SHAPE).view(len(rows), 2, *u.shape)
            # The mean of as many pixels as look at a quarter of a cell is so much less askew than each.
            pixel = self.view.height_m / self.view.focal_px / FINE_M
            askew *= self.noise.sigma_p_px * pixel * min(1, pixel)
            u, v = u + askew[:, 0], v + askew[:, 1]
        motions = self.motions[indices]
        there = cells(read_at(maps, *motions.origins(u, v, FINE_M)).view(-1, 4, *INPUT_SHAPE))
        return motions.finish(there, there.flip(1))

    def batch(self, indices: list[int]) -> torch.Tensor:
        heights, seen = sense(self.moved(indices), self.seeds[indices], self.noise, self.view)
        heights = heights * (heights >= TABLE_M)  # as imaging.network_input has it
        return torch.stack([heights / UNIT_M, seen.to(torch.float32)], dim=1)

    def settings(self) -> object:
        """What a digest is made of, beside the table and the maps."""
        return self.view, self.noise

    def source(self) -> np.ndarray:
        """The maps."""
        return self.maps if isinstance(self.maps, np.ndarray) else self.maps.cpu().numpy()
