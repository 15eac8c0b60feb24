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
        known = [name for name in self._objects.names if self._objects.labelled(name)]
        objects = known or self._objects.names  # what the labels know costs no trial
        # They stand class by class: those taken are spread over all of them.
        places = np.linspace(0, len(objects) - 1, min(conditions.disturb.objects, len(objects))).round().astype(int)
        self.names: list[str] = [*EMPTY, *(objects[i] for i in places)]

    def depends(self, name: str) -> list[Any]:
        """All that the plans of a scene follow from, for the name of its shard."""
        weights = [folder / file for folder in self._folders for file in ("config.json", "weights.safetensors")]
        own = [] if name in EMPTY else self._objects.depends(name)
        return [name, self.conditions, *weights, *own]

    def task(self, name: str) -> tuple[Any, ...]:
        """Arguments of `disturb_case`."""
        if name in EMPTY:
            return Case(name, None, np.zeros(2), 0.0, None), self.conditions, self.networks
        placed, attempts = self._objects.placement(name), self._objects.attempts(name)
        case = Case(name, self._objects.resting(name), placed.shift_uv, placed.theta, attempts)
        return case, self.conditions, self.networks
