"""What the trials of every test object are made of, read from the files of the stages before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from graspfn.evaluation.bench import Bench, Scene
from graspfn.evaluation.expected import Attempts
from graspfn.evaluation.planner import TRUE, UNTRAINED, GraspFunction, Planner
from graspfn.evaluation.trials import Trial, trials_of_object
from graspfn.geometry.grid import sample_cells
from graspfn.imaging.camera import Camera
from graspfn.imaging.height_map import see_heights
from graspfn.imaging.noise import observe
from graspfn.meshes.placed import Resting, load_resting, resting_rows
from graspfn.params import Noise, Table
from graspfn.physics.labelling import held
from graspfn.physics.world import Rig
from graspfn.seeds import generator
from graspfn.workflow.files import read_npz

TOP_CLASS = 5  # whose score is 1: learning.dataset.CLASSES - 1


@dataclass(frozen=True)
class Protocol:
    """How every test object is tried: cells are (sigma_uv [mm], sigma_theta [deg])."""

    rig: Rig
    planner: Planner
    camera: Camera
    table: Table
    noise: Noise
    cells: tuple[tuple[float, float], ...]
    errors: int
    seed: int


class Cases:
    """The test objects with their images, labels, and grasp functions of all networks and training seeds.

    runs: (network, training seed) of every trained network, whose functions lie in data/functions.
    """

    def __init__(self, data: Path, protocol: Protocol, runs: Sequence[tuple[str, int]]):
        self.protocol = protocol
        self._meshes, self._collisions = data / "objects/test", data / "collision/test"
        self._placed = resting_rows(data / "placed/test.parquet")
        self._images = np.load(data / "images/test.npy", mmap_mode="r")
        self._index = pd.read_parquet(data / "images/test.parquet").set_index("id")
        self._predicted = {run: read_npz(data / f"functions/{run[0]}-{run[1]}.npz") for run in runs}
        self._labels = read_npz(data / "labels/test.npz")
        self._labelled = {str(name): i for i, name in enumerate(self._labels["ids"])}
        self.names: list[str] = self._index.index.tolist()

    def depends(self, name: str) -> list[Any]:
        """All that the trials of an object follow from, for the name of its shard."""
        line = self._index.loc[name].to_dict()
        files = [folder / f"{name}.ply" for folder in (self._meshes, self._collisions)]
        arrays = [
            array for f in self._functions(name, line["row"]) for array in (f.f, f.likeliest) if array is not None
        ]
        known = self._known(name)
        return [name, *files, self._placed[name], line, self._images[line["row"]], self.protocol, *arrays, *known]

    def task(self, name: str) -> tuple[Any, ...]:
        """Arguments of `try_object`."""
        p, line = self.protocol, self._index.loc[name].to_dict()
        seen = see_heights(observe(self._images[line["row"]], p.noise, p.seed, name), p.camera, p.table)
        scene = Scene(name, seen, np.array([line["shift_u_m"], line["shift_v_m"]]), float(line["theta_rad"]))
        resting = load_resting(self._meshes, self._collisions, self._placed[name])
        return scene, resting, p, self._functions(name, line["row"]), *self._known(name)

    def _functions(self, name: str, row: int) -> list[GraspFunction]:
        found = [
            GraspFunction(*run, predicted["scores"][row], predicted["likeliest"][row] / np.float32(TOP_CLASS))
            for run, predicted in self._predicted.items()
        ]
        if name in self._labelled:
            f = self._labels["successes"][self._labelled[name]] / float(self._labels["attempts"])
            found.append(GraspFunction(TRUE, UNTRAINED, f))
        return found

    def _known(self, name: str) -> tuple[int | None, np.ndarray | None]:
        """Seed and outcomes of the object's attempts, where it is labelled."""
        if name not in self._labelled:
            return None, None
        i = self._labelled[name]
        return int(self._labels["seeds"][i]), self._labels["outcomes"][i]


def try_object(
    scene: Scene,
    resting: Resting,
    protocol: Protocol,
    functions: Sequence[GraspFunction],
    seed: int | None,
    outcomes: np.ndarray | None,
) -> list[Trial]:
    """The trials of one object; seed, outcomes: of its labels, None where it has none."""
    attempts = None
    if outcomes is not None:  # their poses follow from the seed
        attempts = Attempts(sample_cells(outcomes.shape[-1], np.random.default_rng(seed)), held(outcomes))
    errors = generator(protocol.seed, "evaluate", scene.name).standard_normal((protocol.errors, 3))
    bench = Bench(resting, protocol.rig, scene)
    return trials_of_object(scene, bench, protocol.planner, functions, protocol.cells, errors, attempts)
