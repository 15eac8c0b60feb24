"""Pre-training (paper VII): telling classes of objects apart, before learning to grasp them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
import torch
from torch.nn import functional

from graspfn.learning.dataset import Samples
from graspfn.learning.networks import Classifier, GraspNetwork
from graspfn.learning.training import Descent, Resources, fit
from graspfn.params import Network, Pretrain
from graspfn.seeds import seed_of


def class_indices(classes: Sequence[str]) -> tuple[np.ndarray, list[str]]:
    """Indices (N,) int64 into the sorted distinct names, and those names."""
    names, indices = np.unique(np.asarray(classes, dtype=str), return_inverse=True)
    return indices.astype(np.int64), names.tolist()


def pretrain(
    network: GraspNetwork,
    dataset: Samples,
    names: Sequence[str],
    length: Pretrain,
    params: Network,
    seed: int,
    resources: Resources,
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Trains the network's shared layers in place to tell the classes `names` apart.

    Returns the history and what to note beside the weights: `pretrained_on`, the classes, and if there are none, why.
    """
    history = pd.DataFrame({"step": [], "epoch": [], "learning_rate": [], "loss": []})
    if len(names) < 2:
        reason = f"one class of objects ({', '.join(names)}): nothing to tell apart"
        return history, {"pretrained_on": [], "not_pretrained": reason}
    if length.epochs == 0:
        return history, {"pretrained_on": [], "not_pretrained": "pretrain.epochs is 0"}
    with torch.random.fork_rng():
        torch.manual_seed(seed_of(seed, "pretrain", "head"))
        classifier = Classifier(network, len(names))
    descent = Descent("pretrain", seed, length.epochs, length.batch_size, params.learning_rate, params.weight_decay)
    history = fit(classifier, functional.cross_entropy, dataset, descent, resources)
    return history, {"pretrained_on": list(names)}
