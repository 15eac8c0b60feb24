"""What robustness is tried on: the test objects at their placements, and empty tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from graspfn.evaluation.objects import PlacedObjects
from graspfn.evaluation.robustness import Case, Conditions, Trained
from graspfn.learning.folder import input_kind
from graspfn.learning.weights import load_network

EMPTY = tuple(f"empty table {i}" for i in range(5))  # each with its own noise


class Scenes:
    """Read from the files of the stages before. runs: (network, training seed) of every trained network."""

    def __init__(self, data: Path, conditions: Conditions, runs: Sequence[tuple[str, int]]):
        self.conditions, self._objects = conditions, PlacedObjects(data)
        self._folders = [data / f"networks/{name}-{seed}" for name, seed in runs]
        self.networks = [
            Trained(*run, input_kind(folder), load_network(folder))
            for run, folder in zip(runs, self._folders, strict=True)
        ]
        objects = self._objects.names
        self.names: list[str] = [*EMPTY, *objects]
        # Objects stand class by class: those that are tried are spread over all of them.
        places = np.linspace(0, len(objects) - 1, min(conditions.disturb.objects, len(objects))).round().astype(int)
        self._tried = {objects[i] for i in places}

    def depends(self, name: str) -> list[Any]:
        """All that the plans of a scene follow from, for the name of its shard."""
        weights = [folder / file for folder in self._folders for file in ("config.json", "weights.safetensors")]
        own = [] if name in EMPTY else self._objects.depends(name)
        return [name, name in self._tried, self.conditions, *weights, *own]

    def task(self, name: str) -> tuple[Any, ...]:
        """Arguments of `disturb_case`."""
        if name in EMPTY:
            return Case(name, None, np.zeros(2), 0.0, None, tried=False), self.conditions, self.networks
        placed, attempts = self._objects.placement(name), self._objects.attempts(name)
        resting, tried = self._objects.resting(name), name in self._tried
        case = Case(name, resting, placed.shift_uv, placed.theta, attempts, tried)
        return case, self.conditions, self.networks
