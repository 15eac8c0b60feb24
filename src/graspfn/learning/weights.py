"""A trained network in a folder: weights.safetensors, and config.json to rebuild it by."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

from safetensors import SafetensorError
from safetensors.torch import load_file, save_file

from graspfn.learning.networks import GraspNetwork, build_network
from graspfn.params import Network, build


class WeightsError(ValueError):
    """A folder that holds no network of ours."""


def save_network(folder: Path, network: GraspNetwork, params: Network, **notes: Any) -> None:
    """Writes weights.safetensors and config.json: {"network": the architecture's parameters, **notes}."""
    folder.mkdir(parents=True, exist_ok=True)
    state = {name: tensor.detach().cpu().contiguous() for name, tensor in network.state_dict().items()}
    save_file(state, folder / "weights.safetensors")
    config = {"network": dataclasses.asdict(params), **notes}
    (folder / "config.json").write_text(json.dumps(config, indent=2) + "\n")


def read_config(folder: Path) -> dict[str, Any]:
    """config.json of a network's folder."""
    path = folder / "config.json"
    try:
        return json.loads(path.read_text())
    except FileNotFoundError:
        raise WeightsError(f"{path}: no such file; {folder} takes a trained network") from None
    except json.JSONDecodeError as error:
        raise WeightsError(f"{path}: not JSON: {error}") from None


def load_network(folder: Path) -> GraspNetwork:
    """The network saved in a folder, on the CPU, ready to predict."""
    params = build(Network, read_config(folder).get("network"), f"{folder}/config.json: network")
    network = build_network(params)
    path = folder / "weights.safetensors"
    try:
        network.load_state_dict(load_file(path))
    except FileNotFoundError:
        raise WeightsError(f"{path}: no such file; it takes the weights beside config.json") from None
    except (SafetensorError, RuntimeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise WeightsError(f"{path}: not the weights of the network in config.json: {reason}") from None
    return network.eval()
