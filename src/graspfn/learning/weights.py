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

POINTER = b"version https://git-lfs"  # how Git LFS begins what it leaves in a file's place


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
    """config.json of a network's folder: an object with the key "network"."""
    path = folder / "config.json"
    try:
        config = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise WeightsError(f"{path}: no such file; {folder} takes a trained network") from None
    except OSError as error:
        raise WeightsError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (ValueError, RecursionError) as error:  # bytes that are no text, text that is no JSON
        raise WeightsError(f"{path}: not JSON: {error}") from None
    if not isinstance(config, dict) or "network" not in config:
        raise WeightsError(f"{path}: takes an object with the key 'network', the parameters of the architecture")
    return config


def read_network(folder: Path) -> Network:
    """The parameters of the network saved in a folder; those from before there were height maps say of no input."""
    values = read_config(folder)["network"]
    if isinstance(values, dict):
        values = {"input": "depth"} | values
    return build(Network, values, f"{folder}/config.json: network")


def input_kind(folder: Path) -> str:
    """What the network saved in a folder sees, `network.*.input`."""
    return read_network(folder).input


def load_network(folder: Path) -> GraspNetwork:
    """The network saved in a folder, on the CPU, ready to predict.

    WeightsError or ParameterError, in one line that names the file, where the folder holds anything else.
    """
    params = read_network(folder)
    path = folder / "weights.safetensors"
    try:
        with path.open("rb") as file:
            if file.read(len(POINTER)) == POINTER:
                raise WeightsError(f"{path}: a pointer of Git LFS, not the weights; `git lfs pull` fetches them")
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
