"""What the trials of every test object are made of, read from the files of the stages before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from graspfn.evaluation.bench import Bench, Scene
from graspfn.evaluation.expected import Attempts
from graspfn.evaluation.objects import PlacedObjects
from graspfn.evaluation.planner import GraspFunction, Planner, true_function, view
from graspfn.evaluation.trials import Trial, errors_of, trials_of_object
from graspfn.imaging.camera import Camera
from graspfn.imaging.height_map import HeightMap
from graspfn.imaging.noise import observe
from graspfn.meshes.placed import Resting
from graspfn.params import Noise, Table
from graspfn.physics.world import Rig
from graspfn.workflow.files import read_npz

TOP_CLASS = 5  # whose score is 1: learning.targets.CLASSES - 1


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


def read_functions(path: Path) -> dict[str, np.ndarray]:
    """What stage predict wrote of one network.

    scores: (M, 33, 44, 6) float32, of every row of data/images/test.npy; likeliest: the same, classes uint8, 0 to 5;
    ids: (M,); input: what the network sees.
    """
    predicted = read_npz(path)
    return predicted | {"scores": predicted["scores"].astype(np.float32)}


class Cases:
    """The test objects with their images, labels, and grasp functions of all networks and training seeds.

    runs: (network, training seed) of every trained network, whose functions lie in data/functions.
    """

    def __init__(self, data: Path, protocol: Protocol, runs: Sequence[tuple[str, int]]):
        self.protocol, self._objects = protocol, PlacedObjects(data)
        self._images = np.load(data / "images/test.npy", mmap_mode="r")
        self._predicted = {run: read_functions(data / f"functions/{run[0]}-{run[1]}.npz") for run in runs}
        self.names = self._objects.names

    def depends(self, name: str) -> list[Any]:
        """All that the trials of an object follow from, for the name of its shard."""
        row = self._objects.placement(name).row
        arrays = [f[key][row] for f in self._predicted.values() for key in ("scores", "likeliest")]
        kinds = [str(f["input"]) for f in self._predicted.values()]
        return [*self._objects.depends(name), self._images[row], self.protocol, *kinds, *arrays]

    def task(self, name: str) -> tuple[Any, ...]:
        """Arguments of `try_object`."""
        p, placed = self.protocol, self._objects.placement(name)
        image = observe(self._images[placed.row], p.noise, p.seed, name)
        kinds = {"height_map", *(str(f["input"]) for f in self._predicted.values())}
        seen = {kind: view(image, p.camera, kind, p.table).seen for kind in kinds}
        scene = Scene(name, seen["height_map"], placed.shift_uv, placed.theta)
        attempts = self._objects.attempts(name)
        functions = self._predicted_of(placed.row, seen)
        if attempts is not None:
            functions.append(true_function(attempts))
        return scene, self._objects.resting(name), p, functions, attempts

    def _predicted_of(self, row: int, seen: Mapping[str, HeightMap]) -> list[GraspFunction]:
        """Where the gripper meets what each network sees."""
        gripper, top = self.protocol.rig.gripper, np.float32(TOP_CLASS)
        return [
            GraspFunction(*run, f["scores"][row], f["likeliest"][row] / top).where_met(seen[str(f["input"])], gripper)
            for run, f in self._predicted.items()
        ]


def try_object(
    scene: Scene,
    resting: Resting,
    protocol: Protocol,
    functions: Sequence[GraspFunction],
    attempts: Attempts | None,
) -> list[Trial]:
    """The trials of one object; attempts: of its labels, None where it has none."""
    errors = errors_of(scene.name, protocol.errors, protocol.seed)
    bench = Bench(resting, protocol.rig, scene)
    return trials_of_object(scene, bench, protocol.planner, functions, protocol.cells, errors, attempts)
