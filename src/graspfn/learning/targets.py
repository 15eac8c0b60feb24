"""What a network should say of the lines of an augmentation table: moved grasp functions, or classes of objects."""

from __future__ import annotations

import numpy as np
import pandas as pd
import torch
from torch.nn import functional

from graspfn.geometry.grid import CELL_M, CELL_RAD, SHAPE, axes
from graspfn.learning.motions import Motions

CLASSES = 6  # scores 0, 0.2, ..., 1
N_THETA = SHAPE[2]


def move_labels(f: torch.Tensor, motions: Motions) -> torch.Tensor:
    """f: (B, 6, 33, 44) float32, axes (theta, v, u) -> the same, as `imaging.warp.move_function` moves each.

    Then mirrored, or 0, where the motion says so.

    A turn offsets theta by the same fraction of a cell everywhere, so that trilinear interpolation is a blend of two
    rolled copies and then one bilinear reading.
    """
    cells = motions.theta / CELL_RAD
    whole = cells.ceil()
    upper = (whole - cells).float()[:, None, None, None]
    line, k = torch.arange(len(f))[:, None], torch.arange(N_THETA) - whole.long()[:, None]
    line, k, upper = line.to(f.device), k.to(f.device), upper.to(f.device)
    blend = (1 - upper) * f[line, k % N_THETA] + upper * f[line, (k + 1) % N_THETA]
    v, u, _ = (torch.from_numpy(axis / CELL_M).to(f.device, torch.float32) for axis in axes())
    x, y = motions.origins(u[None, :], v[:, None], CELL_M)
    grid = torch.stack([x * (2 / (SHAPE[1] - 1)), y * (2 / (SHAPE[0] - 1))], dim=-1)
    moved = functional.grid_sample(blend, grid, padding_mode="zeros", align_corners=True)
    # v becomes -v, and with it theta becomes -theta: the jaws of the gripper change places.
    mirrored = moved.flip(2)[:, (-torch.arange(N_THETA)) % N_THETA]
    return motions.finish(moved, mirrored)


def split_classes(scores: torch.Tensor) -> torch.Tensor:
    """(...) of 0 to 5 -> (..., 6): each score shared between the two classes it lies between, so that the expected
    class is the score."""
    return (1 - (scores[..., None] - torch.arange(CLASSES, device=scores.device)).abs()).clamp_(min=0)


class GraspTargets:
    """Moved grasp functions (B, 33, 44, 6) float32, in classes: 0 to 5, and in between where a moved pose is.

    successes: (N, 33, 44, 6) uint8, out of `attempts`, of the objects of the table's rows.
    """

    def __init__(self, successes: np.ndarray, attempts: int, table: pd.DataFrame):
        self.successes, self.unit = torch.tensor(np.ascontiguousarray(successes)), (CLASSES - 1) / attempts
        self.rows, self.motions = torch.tensor(table["row"].to_numpy()), Motions.of(table)

    def to(self, device: torch.device) -> None:
        self.successes = self.successes.to(device)

    def batch(self, indices: list[int]) -> torch.Tensor:
        successes = self.successes[self.rows[indices].to(self.successes.device)]
        f = (successes.to(torch.float32) * self.unit).permute(0, 3, 1, 2).contiguous()
        return move_labels(f, self.motions[indices]).permute(0, 2, 3, 1).contiguous()

    def class_frequencies(self) -> np.ndarray:
        """(6,) share of each score class over all poses of all objects, where they stand unmoved."""
        counts = torch.bincount(self.successes.ravel().long())  # by number of successes
        shares = split_classes(torch.arange(len(counts)) * self.unit).double().T @ counts.double()
        return (shares / counts.sum()).numpy()

    def source(self) -> np.ndarray:
        """What a digest is made of, beside the table."""
        return self.successes.cpu().numpy()


class ClassTargets:
    """Classes (B,) int64. classes: (N,), of the objects of the table's rows."""

    def __init__(self, classes: np.ndarray, table: pd.DataFrame):
        self.classes = torch.tensor(np.asarray(classes, dtype=np.int64))
        self.rows = torch.tensor(table["row"].to_numpy())

    def to(self, device: torch.device) -> None:
        self.classes = self.classes.to(device)

    def batch(self, indices: list[int]) -> torch.Tensor:
        return self.classes[self.rows[indices].to(self.classes.device)]

    def source(self) -> np.ndarray:
        """What a digest is made of, beside the table."""
        return self.classes.cpu().numpy()
