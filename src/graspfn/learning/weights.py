"""A trained network in a folder: weights.safetensors, and config.json to rebuild it by."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file

from graspfn.learning.folder import POINTER, WeightsError, check_pointer, read_network
from graspfn.learning.networks import GraspNetwork, build_network
from graspfn.params import Network

HUGE = 1 << 19  # numbers of a matrix
SCALE = ".scale"  # ends the name of the steps, row by row, of a matrix in 8 bits
STEPS = 127


def save_network(folder: Path, network: GraspNetwork, params: Network, **notes: Any) -> None:
    """Writes weights.safetensors and config.json: {"network": the architecture's parameters, **notes}."""
    _save(folder, _kept(network), params, notes)


def load_network(folder: Path) -> GraspNetwork:
    """The network saved in a folder, on the CPU, ready to predict.

    WeightsError or ParameterError, in one line that names the file, where the folder holds anything else.
    """
    return _load(folder).eval()


def save_pretrained(folder: Path, network: GraspNetwork, params: Network, **notes: Any) -> None:
    """As `save_network`, but without the output layer, which pre-training leaves as it was drawn."""
    shared = {name: tensor for name, tensor in _kept(network).items() if not _of_output(name)}
    _save(folder, shared, params, notes)


def load_pretrained(folder: Path, seed: int) -> GraspNetwork:
    """The network pre-trained in a folder, with the output layer that this seed draws; errors as of `load_network`."""
    return _load(folder, seed, pretrained=True)


def _of_output(name: str) -> bool:
    return "output" in name.split(".")


def _kept(network: GraspNetwork) -> dict[str, torch.Tensor]:
    """Matrices and filters in half precision, which is less than training leaves undecided, and half the file.

    Huge ones (of the layers that make up nearly all of AlexNet) in 8 bits, each row beside its SCALE: a quarter.
    """
    kept = {}
    for name, tensor in network.state_dict().items():
        tensor = tensor.detach().cpu().contiguous()
        if tensor.ndim == 2 and tensor.numel() >= HUGE:
            # Of so few bits that what comes back has the same scale again.
            scale = (tensor.abs().amax(dim=1) / STEPS).clamp(min=torch.finfo(torch.bfloat16).tiny).bfloat16()
            kept[name] = (tensor / scale.to(tensor.dtype)[:, None]).round().to(torch.int8)
            kept[name + SCALE] = scale
        else:
            kept[name] = tensor.half() if tensor.ndim > 1 else tensor
    return kept


def _whole(state: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Inverse of `_kept`, up to the precision."""
    scales = {name.removesuffix(SCALE): tensor for name, tensor in state.items() if name.endswith(SCALE)}
    whole = {name: tensor for name, tensor in state.items() if not name.endswith(SCALE)}
    return whole | {name: whole[name].float() * scale.float()[:, None] for name, scale in scales.items()}


def _save(folder: Path, state: dict[str, torch.Tensor], params: Network, notes: dict[str, Any]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    save_file(state, folder / "weights.safetensors")
    config = {"network": dataclasses.asdict(params), **notes}
    (folder / "config.json").write_text(json.dumps(config, indent=2) + "\n")


def _load(folder: Path, seed: int = 0, pretrained: bool = False) -> GraspNetwork:
    params = read_network(folder)
    path = folder / "weights.safetensors"
    try:
        with path.open("rb") as file:
            check_pointer(path, file.read(len(POINTER)))
        state = _whole(load_file(path))
        network = build_network(params, seed)
        drawn = {name: tensor for name, tensor in network.state_dict().items() if pretrained and _of_output(name)}
        network.load_state_dict(state | drawn)
    except FileNotFoundError:
        raise WeightsError(f"{path}: no such file; it takes the weights beside config.json") from None
    except OSError as error:
        raise WeightsError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (SafetensorError, RuntimeError, TypeError, KeyError) as error:  # TypeError: a width that 64 bits do not hold
        reason = " ".join(str(error).split())[:200]
        raise WeightsError(f"{path}: not the weights of the network in config.json: {reason}") from None
    for name, tensor in state.items():
        if not tensor.isfinite().all():
            raise WeightsError(f"{path}: {name} holds NaN or infinity")
    return network
