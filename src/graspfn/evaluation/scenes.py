"""What robustness is tried on: the test objects at their placements, and empty tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from graspfn.evaluation.expected import Attempts
from graspfn.evaluation.robustness import Case, Conditions, Trained
from graspfn.geometry.grid import sample_cells
from graspfn.learning.weights import input_kind, load_network
from graspfn.meshes.placed import load_resting, resting_rows
from graspfn.physics.labelling import held
from graspfn.workflow.files import read_npz

EMPTY = tuple(f"empty table {i}" for i in range(5))  # each with its own noise


class Scenes:
    """Read from the files of the stages before. runs: (network, training seed) of every trained network."""

    def __init__(self, data: Path, conditions: Conditions, runs: Sequence[tuple[str, int]]):
        self.conditions = conditions
        self._meshes, self._collisions = data / "objects/test", data / "collision/test"
        self._placed = resting_rows(data / "placed/test.parquet")
        self._index = pd.read_parquet(data / "images/test.parquet").set_index("id")
        self._labels = read_npz(data / "labels/test.npz")
        self._labelled = {str(name): i for i, name in enumerate(self._labels["ids"])}
        self._folders = [data / f"networks/{name}-{seed}" for name, seed in runs]
        self.networks = [
            Trained(*run, input_kind(folder), load_network(folder))
            for run, folder in zip(runs, self._folders, strict=True)
        ]
        objects = self._index.index.tolist()
        self.names: list[str] = [*EMPTY, *objects]
        # Objects stand class by class: those that are tried are spread over all of them.
        places = np.linspace(0, len(objects) - 1, min(conditions.disturb.objects, len(objects))).round().astype(int)
        self._tried = {objects[i] for i in places}

    def depends(self, name: str) -> list[Any]:
        """All that the plans of a scene follow from, for the name of its shard."""
        weights = [folder / file for folder in self._folders for file in ("config.json", "weights.safetensors")]
        found: list[Any] = [name, name in self._tried, self.conditions, *weights]
        if name in EMPTY:
            return found
        files = [folder / f"{name}.ply" for folder in (self._meshes, self._collisions)]
        return [*found, *files, self._placed[name], self._index.loc[name].to_dict(), *self._known(name)]

    def task(self, name: str) -> tuple[Any, ...]:
        """Arguments of `disturb_case`."""
        case = Case(name, None, np.zeros(2), 0.0, None, None, tried=False) if name in EMPTY else self._case(name)
        return case, self.conditions, self.networks

    def _case(self, name: str) -> Case:
        line = self._index.loc[name].to_dict()
        shift, theta = np.array([line["shift_u_m"], line["shift_v_m"]]), float(line["theta_rad"])
        resting = load_resting(self._meshes, self._collisions, self._placed[name])
        seed, outcomes = self._known(name)
        attempts, f = None, None
        if outcomes is not None:  # their poses follow from the seed
            attempts = Attempts(sample_cells(outcomes.shape[-1], np.random.default_rng(seed)), held(outcomes))
            f = attempts.held.mean(axis=-1)
        return Case(name, resting, shift, theta, attempts, f, name in self._tried)

    def _known(self, name: str) -> tuple[int | None, np.ndarray | None]:
        """Seed and outcomes of the object's attempts, where it is labelled."""
        if name not in self._labelled:
            return None, None
        i = self._labelled[name]
        return int(self._labels["seeds"][i]), self._labels["outcomes"][i]
