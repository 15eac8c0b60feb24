"""A trained network as ONNX, which runs without torch."""

from __future__ import annotations

import warnings
from pathlib import Path

import torch
from torch import nn

from graspfn.imaging.height_map import SHAPE
from graspfn.learning.networks import GraspNetwork
from graspfn.learning.prediction import expected_scores


class _Scored(nn.Module):
    """input (1, channels, 132, 176) float32 -> scores and likeliest classes (1, 33, 44, 6), as `predict_both`."""

    def __init__(self, network: GraspNetwork):
        super().__init__()
        self.network = network

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        return expected_scores(self.network(x))


def write_onnx(path: Path, network: GraspNetwork, channels: int) -> None:
    """Writes a file of its own, whose bytes follow from the weights alone; the network is left ready to predict.

    By the older of torch's exporters. The newer needs two packages more, takes seven times as long, and writes the
    paths of this machine's source files beside each operation; both give the same network, to 3e-9.
    """
    inputs = torch.zeros(1, channels, *SHAPE)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=DeprecationWarning)  # it will be removed, from torch that is pinned
        torch.onnx.export(
            _Scored(network).eval(),
            (inputs,),
            str(path),
            dynamo=False,
            input_names=["input"],
            output_names=["scores", "likeliest"],
        )
