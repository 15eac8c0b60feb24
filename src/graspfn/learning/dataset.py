"""Training samples, made while training: each is a pure function of one line of the augmentation table."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from torch.utils.data import Dataset

from graspfn.imaging.camera import Camera
from graspfn.learning.depth_inputs import DepthInputs
from graspfn.learning.height_inputs import HeightInputs
from graspfn.learning.sensor import View
from graspfn.learning.targets import ClassTargets, GraspTargets
from graspfn.params import Noise


class Samples(Dataset):
    """Inputs of a network and what it should say of them, per line of the table."""

    def __init__(self, table: pd.DataFrame, inputs: DepthInputs | HeightInputs, targets: GraspTargets | ClassTargets):
        self.table, self.inputs, self.targets = table, inputs, targets

    def __len__(self) -> int:
        return len(self.table)

    def __getitems__(self, indices: list[int]) -> tuple[torch.Tensor, torch.Tensor]:
        """A batch: inputs (B, channels, 132, 176) float32, and targets (B, ...)."""
        return self.inputs.batch(indices), self.targets.batch(indices)

    def __getitem__(self, index: int) -> tuple[torch.Tensor, torch.Tensor]:
        inputs, targets = self.__getitems__([index])
        return inputs[0], targets[0]

    def to(self, device: torch.device) -> bool:
        """Makes batches on the device from now on, if its inputs can be made there: says whether they can."""
        if isinstance(self.inputs, DepthInputs):
            return False
        self.inputs.to(device)
        self.targets.to(device)
        return True

    def digest(self) -> str:
        """Of all that the samples follow from, to tell whether a checkpoint was made from the same."""
        digest = hashlib.sha256(repr((type(self.inputs).__name__, self.inputs.settings())).encode())
        columns = (self.table[name].to_numpy() for name in self.table)
        for array in (*columns, self.inputs.source(), self.targets.source()):
            digest.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def inputs_of(kind: str, folder: Path, table: pd.DataFrame, camera: Camera, noise: Noise) -> DepthInputs | HeightInputs:
    """What a network with this `input` learns from, of the files that stage render_images wrote into a folder."""
    if kind == "depth":
        return DepthInputs(np.load(folder / "train.npy", mmap_mode="r"), table, camera, noise)
    return HeightInputs(np.load(folder / "train_heights.npy", mmap_mode="r"), table, View.of(camera), noise)
