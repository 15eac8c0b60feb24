"""A model's folder: a network, and in config.json all that has to be known to plan with them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from graspfn.geometry import grid

NETWORK = "network.onnx"
DEFAULT = Path(__file__).parents[1] / "models" / "mico-fcn"  # comes with the package
FORMAT = 1  # of config.json; a newer one may say what this code does not know of
GRID = {"shape": list(grid.SHAPE), "cell_m": grid.CELL_M, "cell_rad": grid.CELL_RAD}
# Pixels a side that see a cell of the height map (2.5 mm). Training cameras have 3.5, a D435 at 45 cm 2.5, an Azure
# Kinect at 60 cm 2.1; with fewer, cells go unseen one by one as no network was trained for.
FEWEST_PX = 1.5


class ModelError(ValueError):
    """A folder that holds no model to plan with: one line that says why."""


def check_model(config: dict[str, Any], folder: Path) -> None:
    """ModelError unless config.json is of a format, a grid and a camera that this code plans with."""
    path = folder / "config.json"
    if "format" not in config:
        raise ModelError(f"{path}: format: missing; `graspfn model export` makes a model of a trained network")
    version = config["format"]
    if not isinstance(version, int) or not 1 <= version <= FORMAT:
        raise ModelError(f"{path}: format: is {version!r}; this graspfn reads 1 to {FORMAT}")
    if config.get("grid") != GRID:
        raise ModelError(f"{path}: grid: is {config.get('grid')!r}; this graspfn plans on {GRID}")
    fewest = config["camera"].get("fewest_px") if isinstance(config.get("camera"), dict) else None
    if not isinstance(fewest, int | float) or not fewest > 0:
        raise ModelError(f"{path}: camera.fewest_px: takes a number above 0, not {fewest!r}")
    if not isinstance(config.get("onnx_sha256"), str):
        raise ModelError(f"{path}: onnx_sha256: takes the sha256 of {NETWORK}, not {config.get('onnx_sha256')!r}")


def largest_object_m(config: dict[str, Any], folder: Path) -> float:
    """The largest dimension of an object in training, metres; infinite where config.json does not say."""
    meshes = config["training"].get("meshes") if isinstance(config.get("training"), dict) else None
    most = meshes.get("size_max_cm") if isinstance(meshes, dict) else None
    if most is None:
        return math.inf
    if not isinstance(most, int | float) or not most > 0:
        raise ModelError(f"{folder / 'config.json'}: training.meshes.size_max_cm: takes a number above 0, not {most!r}")
    return float(most) / 100
