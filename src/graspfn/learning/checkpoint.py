"""Checkpoints of a training run: safetensors files that replace each other atomically."""

from __future__ import annotations

import os
from pathlib import Path

import torch
from safetensors import safe_open
from safetensors.torch import save_file
from torch import nn

FILE = "checkpoint.safetensors"


def save_checkpoint(
    folder: Path, key: str, losses: list[float], model: nn.Module, optimizer: torch.optim.Optimizer
) -> None:
    """Weights, AdamW's moments and the loss of every step so far; `key` says which run they belong to."""
    tensors = {f"weights.{name}": tensor for name, tensor in model.state_dict().items()}
    for index, state in optimizer.state_dict()["state"].items():
        tensors |= {f"moments.{index}.{name}": tensor for name, tensor in state.items()}
    tensors["losses"] = torch.tensor(losses, dtype=torch.float64)
    folder.mkdir(parents=True, exist_ok=True)
    unfinished = folder / f"{FILE}.tmp"
    save_file({name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}, unfinished, {"key": key})
    os.replace(unfinished, folder / FILE)


def load_checkpoint(folder: Path, key: str, model: nn.Module, optimizer: torch.optim.Optimizer) -> list[float]:
    """Puts model and optimizer where the run `key` was interrupted and returns the losses of the steps it had made.

    Without a checkpoint, or with one of another run, changes nothing and returns no losses.
    """
    if not (folder / FILE).exists():
        return []
    with safe_open(folder / FILE, framework="pt") as file:
        if file.metadata()["key"] != key:
            return []
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a mapping)
    model.load_state_dict({name[8:]: tensor for name, tensor in tensors.items() if name.startswith("weights.")})
    weights = [weight for group in optimizer.param_groups for weight in group["params"]]
    state: dict[int, dict[str, torch.Tensor]] = {}
    for name, tensor in tensors.items():
        if name.startswith("moments."):
            _, index, moment = name.split(".")
            weight = weights[int(index)]
            if tensor.shape == weight.shape:
                # The fused AdamW walks weights and moments in memory order: a moment takes its weight's layout.
                tensor = torch.empty_like(weight).copy_(tensor)
            state.setdefault(int(index), {})[moment] = tensor
    optimizer.load_state_dict({**optimizer.state_dict(), "state": state})
    return tensors["losses"].tolist()


def remove_checkpoint(folder: Path) -> None:
    """A finished run leaves none behind."""
    (folder / FILE).unlink(missing_ok=True)
