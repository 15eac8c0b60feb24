"""Models as `graspfn model export` leaves them, of any network and without a run."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path
from typing import Any

from physics_params import PARAMS

from graspfn.learning.networks import GraspNetwork
from graspfn.learning.onnx_file import write_onnx
from graspfn.learning.weights import save_network
from graspfn.params import Network
from graspfn.planning.model import FEWEST_PX, FORMAT, GRID, NETWORK


def save_model(folder: Path, network: GraspNetwork, params: Network, **changes: Any) -> None:
    """changes: what config.json has otherwise than PARAMS and this version of graspfn have it."""
    folder.mkdir(parents=True, exist_ok=True)
    write_onnx(folder / NETWORK, network, params.channels)
    notes = {name: dataclasses.asdict(getattr(PARAMS, name)) for name in ("gripper", "table", "plan")}
    notes |= {"format": FORMAT, "grid": GRID, "camera": {"fewest_px": FEWEST_PX}}
    notes["onnx_sha256"] = hashlib.sha256((folder / NETWORK).read_bytes()).hexdigest()
    save_network(folder, network, params, **(notes | changes))
