"""What config.json says of a network in a folder; read without torch, which takes a second to load."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from graspfn.params import Network, build

POINTER = b"version https://git-lfs"  # how Git LFS begins what it leaves in a file's place


class WeightsError(ValueError):
    """A folder that holds no network of ours."""


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


def check_pointer(path: Path, content: bytes) -> None:
    """WeightsError where a file is what Git LFS leaves in its place."""
    if content.startswith(POINTER):
        raise WeightsError(f"{path}: a pointer of Git LFS, not the weights; `git lfs pull` fetches them")
