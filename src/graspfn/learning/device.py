"""Where torch computes."""

from __future__ import annotations

import torch

from graspfn.learning.training import Resources
from graspfn.params import Compute
from graspfn.workflow.shards import SCRATCH


def pick_device(name: str) -> torch.device:
    """The device called `name`; "auto" takes cuda, else mps, else cpu."""
    available = {"cuda": torch.cuda.is_available(), "mps": torch.backends.mps.is_available(), "cpu": True}
    if name == "auto":
        name = next(kind for kind, there in available.items() if there)
    if not available.get(name, False):
        raise ValueError(f"compute.device: {name} is not available; here it takes auto or cpu")
    return torch.device(name)


def resources(compute: Compute, run: str) -> Resources:
    """What a training run may use on this machine; `run` names its checkpoints, kept in the ignored scratch folder."""
    return Resources(pick_device(compute.device), SCRATCH / "checkpoints" / run, compute.checkpoint_s, compute.loaders)
