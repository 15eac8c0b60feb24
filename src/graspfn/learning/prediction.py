"""Predicting grasp functions."""

from __future__ import annotations

import numpy as np
import torch

from graspfn.geometry.grid import SHAPE
from graspfn.learning.dataset import CLASSES
from graspfn.learning.device import torch_threads
from graspfn.learning.networks import GraspNetwork

BATCH = 16


def predict(network: GraspNetwork, inputs: np.ndarray, device: torch.device | None = None) -> np.ndarray:
    """inputs: (M, 132, 176) float32 of `imaging.network_input` -> scores (M, 33, 44, 6) float32 in [0, 1].

    A pose's score is its expectation under the predicted probabilities of 0, 0.2, ..., 1: the mean success rate that
    smoothing then averages, where the single likeliest class would jump.
    """
    device = device or torch.device("cpu")
    network = network.to(device).eval()
    values = torch.linspace(0, 1, CLASSES, device=device)
    scores = np.empty((len(inputs), *SHAPE), dtype=np.float32)
    with torch.inference_mode(), torch_threads(1):
        for start in range(0, len(inputs), BATCH):
            batch = torch.from_numpy(np.ascontiguousarray(inputs[start : start + BATCH], dtype=np.float32))
            logits = network(batch[:, None].to(device))
            scores[start : start + BATCH] = (logits.softmax(dim=-1) @ values).cpu().numpy()
    return scores
