"""The test objects where stage render_images placed them, and what their labels know of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from graspfn.evaluation.expected import Attempts
from graspfn.geometry.grid import sample_cells
from graspfn.meshes.placed import Resting, load_resting, resting_rows
from graspfn.physics.labelling import held
from graspfn.workflow.files import read_npz


@dataclass(frozen=True, eq=False)
class Placement:
    """Where an object stands: row of data/images/test.npy, shift_uv (2,) metres and theta of `T_world_scene`."""

    row: int
    shift_uv: np.ndarray
    theta: float


class PlacedObjects:
    """Read from the files of the stages before; `names` in the order of data/images/test.parquet."""

    def __init__(self, data: Path):
        self._folders = data / "objects/test", data / "collision/test"
        self._placed = resting_rows(data / "placed/test.parquet")
        self._index = pd.read_parquet(data / "images/test.parquet").set_index("id")
        self._labels = read_npz(data / "labels/test.npz")
        self._labelled = {str(name): i for i, name in enumerate(self._labels["ids"])}
        self.names: list[str] = self._index.index.tolist()

    def depends(self, name: str) -> list[Any]:
        """All that an object, its placement and its labels follow from, for the name of a shard."""
        files = [folder / f"{name}.ply" for folder in self._folders]
        return [name, *files, self._placed[name], self._index.loc[name].to_dict(), *self._known(name)]

    def resting(self, name: str) -> Resting:
        """The object as it was labelled."""
        return load_resting(*self._folders, self._placed[name])

    def placement(self, name: str) -> Placement:
        line = self._index.loc[name].to_dict()
        return Placement(line["row"], np.array([line["shift_u_m"], line["shift_v_m"]]), line["theta_rad"])

    def labelled(self, name: str) -> bool:
        return name in self._labelled

    def attempts(self, name: str) -> Attempts | None:
        """Those of the object's labels, whose poses follow from their seed; None where it has none."""
        seed, outcomes = self._known(name)
        if outcomes is None:
            return None
        return Attempts(sample_cells(outcomes.shape[-1], np.random.default_rng(seed)), held(outcomes))

    def _known(self, name: str) -> tuple[int | None, np.ndarray | None]:
        """Seed and outcomes of the object's attempts."""
        if name not in self._labelled:
            return None, None
        i = self._labelled[name]
        return int(self._labels["seeds"][i]), self._labels["outcomes"][i]
