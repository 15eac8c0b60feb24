"""The scenes that the simulated robot meets: test objects at random placements, seen and planned on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from graspfn.evaluation.bench import Scene
from graspfn.evaluation.planner import GraspFunction, Planner, View, view
from graspfn.geometry import grid
from graspfn.geometry.transforms import T_world_scene
from graspfn.imaging.camera import Camera
from graspfn.imaging.placement import PLACING, random_placement
from graspfn.imaging.renderers import Renderer
from graspfn.learning.networks import GraspNetwork
from graspfn.learning.prediction import predict
from graspfn.meshes.placed import load_resting, resting_rows
from graspfn.meshes.store import read_manifest
from graspfn.params import Noise, Table
from graspfn.physics.world import Rig
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.robot.simulated import Seen, see
from graspfn.seeds import generator


class Scenes:
    """So many placements of the first test objects, in the order of selection, which takes classes in turn.

    networks: by name, each with its training seed and its `network.*.input`. cells: (sigma_uv [mm], sigma_theta [deg])
    of each condition.
    """

    def __init__(
        self,
        data: Path,
        objects: int,
        placements: int,
        networks: Mapping[str, tuple[int, str, GraspNetwork]],
        cells: list[tuple[float, float]],
        planner: Planner,
        camera: Camera,
        table: Table,
        noise: Noise,
        render: Renderer,
        rig: Rig,
        device: torch.device,
    ):
        self.networks, self.cells, self.planner, self.noise = networks, cells, planner, noise
        self.camera, self.table, self.render, self.rig, self.device = camera, table, render, rig, device
        self._folders = data / "objects/test", data / "collision/test"
        self._placed = resting_rows(data / "placed/test.parquet")
        order = read_manifest(self._folders[0]).sort_values("seed_index")["id"]
        chosen = [name for name in order if name in self._placed][:objects]
        self.keys = {f"{name}-{placement}": (name, placement) for name in chosen for placement in range(placements)}

    def depends(self, key: str) -> list[Any]:
        """All that the trials of a scene follow from but the networks, for the name of its shard."""
        name, placement = self.keys[key]
        files = [folder / f"{name}.ply" for folder in self._folders]
        setting = self.cells, self.planner, self.camera, self.table, self.noise, self.rig
        return [*files, self._placed[name], name, placement, *setting]

    def task(self, key: str) -> tuple[Any, ...]:
        """Arguments of `simulated.record`."""
        name, placement = self.keys[key]
        resting, camera, seed = load_resting(*self._folders, self._placed[name]), self.camera, self.planner.seed
        mesh, T = resting.mesh, resting.T_world_object
        rng = generator(seed, "record_robot", name, placement)
        shift, theta = random_placement(self.render(mesh, T, PLACING), rng)
        raw = see(self.render(mesh, T_world_scene(shift, theta) @ T, camera), self.noise, camera, rng)
        kinds = {"height_map", *(kind for _, kind, _ in self.networks.values())}
        views = {kind: view(raw, camera, kind, self.table) for kind in kinds}
        scene = Scene(key, views["height_map"].seen, shift, theta)
        functions = self._functions(views)
        plans = self.planner.plans(scene, functions, [PoseUncertainty.of(*cell) for cell in self.cells])
        return Seen(name, placement, raw, scene), self.cells, plans, resting, self.rig, camera, seed

    def _functions(self, views: Mapping[str, View]) -> list[GraspFunction]:
        functions = []
        for name, (seed, kind, network) in self.networks.items():
            inputs, f = views[kind].inputs, np.zeros(grid.SHAPE, np.float32)
            if inputs is not None:
                f = predict(network, inputs[None], self.device)[0]
            functions.append(GraspFunction(name, seed, f).where_met(views[kind].seen, self.rig.gripper))
        return functions
