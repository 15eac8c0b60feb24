"""The models that come with the package: what their cards say, the gripper that they are for, and grasps that hold."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from physics_params import ROOT
from test_planning_planner import CAMERA, seen

from graspfn.commands.card import card
from graspfn.compose import compose
from graspfn.geometry.transforms import T_world_scene, translation, unmove_pose
from graspfn.meshes.placed import Resting
from graspfn.params import Params, validate
from graspfn.physics.attempt import Grasper
from graspfn.physics.world import Rig
from graspfn.planning.model import DEFAULT
from graspfn.planning.planner import Grasp, GraspPlanner
from graspfn.planning.uncertainty import PoseUncertainty

MODELS = sorted(folder for folder in DEFAULT.parent.iterdir() if folder.is_dir())
SHAPES = {
    "bar": trimesh.creation.box((0.12, 0.03, 0.03)),
    "can": trimesh.creation.cylinder(0.022, 0.04),
    "block": trimesh.creation.box((0.05, 0.035, 0.035)),
    "plate on edge": trimesh.creation.box((0.11, 0.02, 0.04)),
    "two bars": trimesh.boolean.union(
        [trimesh.creation.box((0.13, 0.025, 0.03)), trimesh.creation.box((0.025, 0.13, 0.03))]
    ),
}
LONG = ("bar", "plate on edge")  # longer than any of the jaws opens


def every(function):
    return pytest.mark.parametrize("folder", MODELS, ids=[folder.name for folder in MODELS])(function)


def config(folder: Path) -> dict:
    return json.loads((folder / "config.json").read_text())


def params_of(folder: Path) -> Params:
    """conf/ of today, with the gripper that the model names."""
    return validate(compose([f"gripper={config(folder)['gripper']['name']}"], ROOT / "conf"))


@every
def test_its_card_is_of_its_numbers(folder):
    said = config(folder)
    assert said["name"] == folder.name and said["metrics"]["test_objects"] >= 80
    assert said["metrics"]["train_objects"] >= 290
    assert (folder / "README.md").read_text() == card(said)
    assert hashlib.sha256((folder / "network.onnx").read_bytes()).hexdigest() == said["onnx_sha256"]


@every
def test_it_is_for_the_gripper_that_it_names(folder):
    """And of the physics of params.yaml: whoever edits conf/ is told that a model knows it as it was."""
    params = params_of(folder)
    assert GraspPlanner.load(folder).gripper == params.gripper
    assert config(folder)["physics"] == dataclasses.asdict(params.physics)


def test_the_default_one_is_of_the_run_that_comes_along():
    """docs/planning.md says how it is made anew."""
    trained = hashlib.md5((DEFAULT / "weights.safetensors").read_bytes()).hexdigest()
    assert (ROOT / "artifacts/files/md5" / trained[:2] / trained[2:]).is_file()


@every
def test_what_it_plans_is_held(folder):
    """On images of five shapes, turned and shifted, in DART with the gripper that it is for."""
    planner, params = GraspPlanner.load(folder), params_of(folder)
    rng, rig = np.random.default_rng(5), Rig(params.physics, params.gripper, params.attempt)
    held = across = 0
    for name, mesh in SHAPES.items():
        resting = Resting(mesh, mesh, translation(0, 0, -mesh.bounds[0, 2]))
        for _ in range(3):
            shift, theta = rng.uniform(-0.06, 0.06, 2), rng.uniform(0, 2 * np.pi)
            thing = (mesh, T_world_scene(shift, theta) @ resting.T_world_object)
            found = planner.plan(seen(CAMERA, thing), CAMERA, PoseUncertainty.of(5, 10))
            assert isinstance(found, Grasp), found
            q, grasper = unmove_pose(found.q, shift, theta), Grasper(resting, rig)
            held += grasper.run(q).held
            across += name in LONG and grasper.run(q + np.array([0, 0, np.pi / 2])).held
    assert held >= 14 and across == 0, held
