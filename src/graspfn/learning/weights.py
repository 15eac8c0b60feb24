"""A trained network in a folder: weights.safetensors, and config.json to rebuild it by."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

from safetensors import SafetensorError
from safetensors.torch import load_file, save_file

from graspfn.learning.folder import POINTER, WeightsError, check_pointer, read_network
from graspfn.learning.networks import GraspNetwork, build_network
from graspfn.params import Network


def save_network(folder: Path, network: GraspNetwork, params: Network, **notes: Any) -> None:
    """Writes weights.safetensors and config.json: {"network": the architecture's parameters, **notes}."""
    folder.mkdir(parents=True, exist_ok=True)
    state = {name: tensor.detach().cpu().contiguous() for name, tensor in network.state_dict().items()}
    save_file(state, folder / "weights.safetensors")
    config = {"network": dataclasses.asdict(params), **notes}
    (folder / "config.json").write_text(json.dumps(config, indent=2) + "\n")


def load_network(folder: Path) -> GraspNetwork:
    """The network saved in a folder, on the CPU, ready to predict.

    WeightsError or ParameterError, in one line that names the file, where the folder holds anything else.
    """
    params = read_network(folder)
    path = folder / "weights.safetensors"
    try:
        with path.open("rb") as file:
            check_pointer(path, file.read(len(POINTER)))
        state = load_file(path)
        network = build_network(params)
        network.load_state_dict(state)
    except FileNotFoundError:
        raise WeightsError(f"{path}: no such file; it takes the weights beside config.json") from None
    except OSError as error:
        raise WeightsError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (SafetensorError, RuntimeError, TypeError) as error:  # TypeError: a width that 64 bits do not hold
        reason = " ".join(str(error).split())[:200]
        raise WeightsError(f"{path}: not the weights of the network in config.json: {reason}") from None
    for name, tensor in state.items():
        if not tensor.isfinite().all():
            raise WeightsError(f"{path}: {name} holds NaN or infinity")
    return network.eval()
