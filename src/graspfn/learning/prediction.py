"""Predicting grasp functions."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch

from graspfn.geometry.grid import SHAPE
from graspfn.learning.device import torch_threads
from graspfn.learning.networks import GraspNetwork
from graspfn.learning.targets import CLASSES
from graspfn.workflow.cores import cores

BATCH = 16


def predict(network: GraspNetwork, inputs: np.ndarray, device: torch.device | None = None) -> np.ndarray:
    """inputs: (M, channels, 132, 176) float32, or (M, 132, 176) of one -> scores (M, 33, 44, 6) float32 in [0, 1].

    A pose's score is its expectation under the predicted probabilities of 0, 0.2, ..., 1: the mean success rate that
    smoothing then averages, where the single likeliest class would jump. Bits do not depend on the number of cores.
    """
    return predict_both(network, inputs, device)[0]


def expected_scores(logits: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """logits (..., 6) -> scores (...) and likeliest classes (...) uint8."""
    values = torch.linspace(0, 1, CLASSES, device=logits.device)
    return logits.softmax(dim=-1) @ values, logits.argmax(dim=-1).to(torch.uint8)


def predict_both(
    network: GraspNetwork, inputs: np.ndarray, device: torch.device | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """As `predict`, and beside the scores the likeliest classes (M, 33, 44, 6) uint8, 0 to 5: what the paper scores by
    (V)."""
    device = device or torch.device("cpu")
    network = network.to(device).eval()
    inputs = inputs if inputs.ndim == 4 else inputs[:, None]

    def batch_of(start: int) -> tuple[np.ndarray, np.ndarray]:
        batch = torch.from_numpy(np.ascontiguousarray(inputs[start : start + BATCH], dtype=np.float32))
        with torch.inference_mode():
            scores, likeliest = expected_scores(network(batch.to(device)))
            return scores.cpu().numpy(), likeliest.cpu().numpy()

    # Whole batches side by side, a thread each: threads that share a sum would show in its last bits.
    with torch_threads(1), ThreadPoolExecutor(cores() if device.type == "cpu" else 1) as threads:
        parts = list(threads.map(batch_of, range(0, len(inputs), BATCH)))
    nothing = np.empty((0, *SHAPE), np.float32), np.empty((0, *SHAPE), np.uint8)
    scores, likeliest = (np.concatenate(every) for every in zip(nothing, *parts, strict=True))
    return scores, likeliest


class OneByOne:
    """A network as a planner calls it: for one image at a time, from any thread."""

    def __init__(self, network: GraspNetwork, device: torch.device | None = None):
        self._network, self._device, self._turn = network, device, threading.Lock()

    def __call__(self, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(channels, 132, 176) float32 -> scores (33, 44, 6) float32 and likeliest classes (33, 44, 6) uint8."""
        with self._turn:  # how many threads torch takes is set for the whole process
            scores, likeliest = predict_both(self._network, inputs[None], self._device)
        return scores[0], likeliest[0]
