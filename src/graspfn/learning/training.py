"""Learning by gradient descent: one loop, for the grasp function (paper V) and for pre-training.

A run is a pure function of its seed, data, parameters, device kind and number of threads (sums over a batch depend on
how threads share it, hence the argument): sample order and dropout masks are drawn from (seed, step), so that a run
that was interrupted and resumed ends with the same bits on a CPU as one that was not.
"""

from __future__ import annotations

import functools
import hashlib
import itertools
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from torch import multiprocessing, nn
from torch.utils.data import DataLoader
from tqdm import tqdm

from graspfn.learning.checkpoint import load_checkpoint, remove_checkpoint, save_checkpoint
from graspfn.learning.dataset import Samples
from graspfn.learning.device import pick_device, torch_threads
from graspfn.learning.networks import GraspNetwork
from graspfn.learning.targets import CLASSES, GraspTargets
from graspfn.params import Compute, Network, Train
from graspfn.seeds import generator, seed_of
from graspfn.workflow.shards import SCRATCH, code_digest

BLOCK = 256  # samples made at once on a device other than the CPU
WARM_UP = 0.1  # share of the steps over which the learning rate rises
Loss = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]


class TrainingError(ValueError):
    """Training went wrong in a way that a parameter mends."""


@dataclass(frozen=True)
class Resources:
    """What a run may use; only `device` and `threads` can change its last bits."""

    device: torch.device
    checkpoint_folder: Path
    checkpoint_s: float
    loaders: int = 0
    threads: int = 1
    progress: bool = True


def resources(compute: Compute, run: str) -> Resources:
    """What a training run may use on this machine; `run` names its checkpoints, kept in the ignored scratch folder."""
    return Resources(pick_device(compute.device), SCRATCH / "checkpoints" / run, compute.checkpoint_s, compute.loaders)


@dataclass(frozen=True)
class Descent:
    """How long and how fast."""

    stage: str
    seed: int
    epochs: float
    batch_size: int
    learning_rate: float
    weight_decay: float

    def steps(self, samples: int) -> int:
        return max(1, round(self.epochs * samples / self.batch_size))

    def rate(self, step: int, steps: int) -> float:
        """Rises linearly over the first tenth of the steps, then falls to 0 along half a cosine."""
        rising = max(1, round(WARM_UP * steps))
        if step < rising:
            return self.learning_rate * (step + 1) / rising
        return self.learning_rate * 0.5 * (1 + math.cos(math.pi * (step + 1 - rising) / (steps - rising + 1)))


def grasp_loss(logits: torch.Tensor, scores: torch.Tensor) -> torch.Tensor:
    """Cross-entropy, averaged over images and poses; logits (B, 33, 44, 6, 6), scores (B, 33, 44, 6) float32, 0 to 5.

    A moved label lies between the cells of Q and its score between two classes, which share it.
    The paper prints its loss (eq. 3) without a logarithm, as the probability of the right class: minimised, that would
    drive the right class away. Cross-entropy is what the text describes.
    """
    logits, scores = logits.reshape(-1, CLASSES), scores.reshape(-1)
    lower = scores.floor().clamp_(max=CLASSES - 2)
    share = scores - lower  # of the upper class; a third of the time of cross_entropy with all six
    beside = logits.gather(1, torch.stack([lower, lower + 1], dim=1).long())
    return (logits.logsumexp(dim=1) - (1 - share) * beside[:, 0] - share * beside[:, 1]).mean()


def batches(samples: int, descent: Descent, start: int, stop: int) -> Iterator[list[int]]:
    """Sample indices of the steps start..stop: shuffled epoch after shuffled epoch, cut into equal batches."""

    @functools.lru_cache(maxsize=2)
    def order(epoch: int) -> np.ndarray:
        return generator(descent.seed, descent.stage, "order", epoch).permutation(samples)

    for step in range(start, stop):
        places = range(step * descent.batch_size, (step + 1) * descent.batch_size)
        yield [int(order(place // samples)[place % samples]) for place in places]


def _run_key(model: nn.Module, dataset: Samples, descent: Descent, resources: Resources) -> str:
    """Equal for two runs that would do the same: network, initial weights, data, parameters, threads, code."""
    digest = hashlib.sha256(repr((model, descent, dataset.digest(), resources.threads, resources.device.type)).encode())
    digest.update(code_digest("seeds.py", "geometry", "imaging", "learning").encode())
    for tensor in model.state_dict().values():
        digest.update(tensor.detach().cpu().contiguous().numpy().tobytes())
    return digest.hexdigest()


def fit(model: nn.Module, loss: Loss, dataset: Samples, descent: Descent, resources: Resources) -> pd.DataFrame:
    """Trains the model in place; returns its history, one line per step: step, epoch, learning_rate, loss."""
    samples = len(dataset)
    steps = descent.steps(samples)
    with torch_threads(resources.threads):
        model.to(resources.device)
        model.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # a fifth faster on a CPU
        key = _run_key(model, dataset, descent, resources)
        optimizer = torch.optim.AdamW(
            model.parameters(), descent.learning_rate, weight_decay=descent.weight_decay, fused=True
        )
        losses = load_checkpoint(resources.checkpoint_folder, key, model, optimizer)
        _descend(model, loss, dataset, optimizer, losses, key, descent, resources)
    remove_checkpoint(resources.checkpoint_folder)
    step = np.arange(steps)
    return pd.DataFrame(
        {
            "step": step,
            "epoch": (step + 1) * descent.batch_size / samples,
            "learning_rate": [descent.rate(s, steps) for s in range(steps)],
            "loss": losses,
        }
    )


def _arrays(batch: Any) -> tuple[np.ndarray, ...]:
    """Arrays come from a loader through a pipe, tensors through /dev/shm, in which containers have little."""
    return tuple(part.numpy() for part in batch)


def _made_here(dataset: Samples, places: Iterator[list[int]]) -> Iterator[tuple[torch.Tensor, torch.Tensor]]:
    """Batches made on the device, several at once: a batch is little work for it, and starting that work is most."""
    for first in places:
        block = [first, *itertools.islice(places, max(BLOCK // len(first) - 1, 0))]
        made = dataset.__getitems__(list(itertools.chain(*block)))
        yield from zip(*(part.split(len(first)) for part in made), strict=True)


def _load(
    dataset: Samples, places: Callable[[], Iterator[list[int]]], resources: Resources
) -> Iterator[tuple[torch.Tensor | np.ndarray, ...]]:
    """Batches of (inputs, targets), one after the other, made on the device where it is not the CPU, or else by
    `resources.loaders` processes where these can be started."""
    if resources.device.type != "cpu" and dataset.to(resources.device):
        return _made_here(dataset, places())
    loaders = resources.loaders
    try:
        # More semaphores than they need, which lie in /dev/shm: a loader that finds none later says so at length.
        _ = [multiprocessing.Queue() for _ in range(4 * loaders)]
        return iter(DataLoader(dataset, batch_sampler=places(), num_workers=loaders, collate_fn=_arrays))
    except OSError as error:
        print(f"compute.loaders: none could be started ({error.strerror}); samples are made by the trainer itself")
        return iter(DataLoader(dataset, batch_sampler=places(), collate_fn=_arrays))


def _descend(
    model: nn.Module,
    loss: Loss,
    dataset: Samples,
    optimizer: torch.optim.Optimizer,
    losses: list[float],
    key: str,
    descent: Descent,
    resources: Resources,
) -> None:
    """The steps that `losses` does not have yet, appending to it."""
    samples, start = len(dataset), len(losses)
    steps = descent.steps(samples)
    loader = _load(dataset, lambda: batches(samples, descent, start, steps), resources)
    bar = tqdm(total=steps, initial=start, desc=descent.stage, unit="step", disable=not resources.progress)
    saved = time.monotonic()
    model.train()
    for step, (inputs, targets) in zip(range(start, steps), loader, strict=True):
        torch.manual_seed(seed_of(descent.seed, descent.stage, "dropout", step))
        for group in optimizer.param_groups:
            group["lr"] = descent.rate(step, steps)
        optimizer.zero_grad()
        images = torch.as_tensor(inputs).to(resources.device, memory_format=torch.channels_last)
        value = loss(model(images), torch.as_tensor(targets).to(resources.device))
        value.backward()
        optimizer.step()
        losses.append(value.item())
        if not math.isfinite(losses[-1]):
            bar.close()
            raise TrainingError(
                f"network.learning_rate: at {descent.learning_rate:g} the loss became {losses[-1]} in step {step + 1} "
                f"of {steps}; it takes a smaller one"
            )
        bar.set_postfix(loss=f"{losses[-1]:.4f}", refresh=False)
        bar.update()
        if time.monotonic() - saved > resources.checkpoint_s and step + 1 < steps:
            save_checkpoint(resources.checkpoint_folder, key, losses, model, optimizer)
            saved = time.monotonic()
    bar.close()


def train(
    network: GraspNetwork, dataset: Samples, length: Train, params: Network, seed: int, resources: Resources
) -> pd.DataFrame:
    """Trains the network in place on the grasp functions of the dataset; returns the history of `fit`."""
    assert isinstance(dataset.targets, GraspTargets)
    network.set_prior(dataset.targets.class_frequencies())
    descent = Descent("train", seed, length.epochs, length.batch_size, params.learning_rate, params.weight_decay)
    return fit(network, grasp_loss, dataset, descent, resources)
