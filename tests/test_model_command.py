"""`graspfn model export`: a folder that says all it needs to be used right, made of what dvc.lock says was run."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import shutil
from pathlib import Path

import pytest
import yaml
from physics_params import PARAMS
from typer.testing import CliRunner

from graspfn.cli import app
from graspfn.learning.networks import build_network
from graspfn.learning.weights import save_network
from graspfn.planning.planner import GraspPlanner

ROOT = Path(__file__).parents[1]
NARROW = {"value": 0.87, "ci_low": 0.8, "ci_high": 0.92}
SUCCESS = {"mean_success": 0.61, "ci_low": 0.55, "ci_high": 0.66, "networks": 1, "success_uv5_theta10": NARROW}
CEILING = SUCCESS | {"mean_success": 0.71, "objects": 60}
METHODS = {"robust_best_grasp": SUCCESS, "best_grasp": SUCCESS}


def md5(path: str) -> str:
    return hashlib.md5(Path(path).read_bytes()).hexdigest()


def tree(folder: str) -> str:
    listed = [{"md5": md5(str(path)), "relpath": path.name} for path in sorted(Path(folder).iterdir())]
    return hashlib.md5(json.dumps(listed, sort_keys=True).encode()).hexdigest() + ".dir"


@pytest.fixture
def run(tmp_path, monkeypatch) -> Path:
    """The files of a run that the command reads, with the dvc.lock that DVC would have written."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "params.yaml", tmp_path)
    save_network(tmp_path / "data/networks/fcn-0", build_network(PARAMS.network["fcn"]), PARAMS.network["fcn"])
    Path("data/functions").mkdir()
    Path("data/functions/fcn-0.npz").write_text("functions")
    Path("reports/desktop").mkdir(parents=True)
    true = {"robust_best_grasp": CEILING}
    table = {"objects": 84, "centroid": SUCCESS, "fcn": METHODS, "true_function": true}
    Path("reports/desktop/metrics.json").write_text(json.dumps({"table1": {"all": table}, "labels": {"objects": 41}}))
    values = json.loads(json.dumps(dataclasses.asdict(PARAMS)))

    def stage(params="", outs=(), deps=()):
        def files(paths):
            return [{"path": path, "md5": tree(path) if Path(path).is_dir() else md5(path)} for path in paths]

        section = {key: values[key] for key in params.split()}
        return {"params": {"params.yaml": section}, "outs": files(outs), "deps": files(deps)}

    weights = "data/networks/fcn-0/weights.safetensors"
    stages = {
        "select_meshes": stage("meshes seed"),
        "place_objects": stage("settle"),
        "label_grasps@train": stage("physics gripper attempt label"),
        "augment": stage("augment"),
        "train@fcn-0": stage("camera noise train", outs=[weights]),
        "predict@fcn-0": stage("table", outs=["data/functions/fcn-0.npz"], deps=["data/networks/fcn-0"]),
        "evaluate": stage("plan", deps=["data/functions"]),
        "report": stage("scale", outs=["reports/desktop/metrics.json"]),
    }
    Path("dvc.lock").write_text(yaml.safe_dump({"stages": stages}))
    return tmp_path


def export(*arguments: str):
    return CliRunner().invoke(app, ["model", "export", "out", *arguments])


def config() -> dict:
    return json.loads(Path("out/config.json").read_text())


def test_a_model_says_all_it_needs_to_be_used_right(run):
    result = export()
    assert (result.exit_code, result.stdout) == (0, "out: a model of fcn-0\n"), result.output
    files = {"network.onnx", "weights.safetensors", "config.json", "README.md"}
    assert {path.name for path in Path("out").iterdir()} == files
    planner = GraspPlanner.load(Path("out"))
    assert (planner.gripper, planner.table, planner.refinement) == (PARAMS.gripper, PARAMS.table, PARAMS.plan)
    said = config()
    assert said["metrics"]["robust"] == SUCCESS and said["metrics"]["test_objects"] == 84
    assert {"licence", "noise", "physics", "versions", "network", "grid"} <= set(said)
    assert (said["name"], said["run"], said["training"]["scale"]) == ("out", "fcn-0", PARAMS.scale)
    assert said["training"]["seed"] == PARAMS.seed and said["training"]["meshes"]["train"] == PARAMS.meshes.train
    card = Path("out/README.md").read_text()
    head, line, *rows = (line for line in card.splitlines() if line.startswith("|"))
    assert (head, line) == ("| `--method` | mean of Table 1 | 5 mm, 10° |", "|---|---|---|")
    assert rows[0] == "| robust | 0.610 [0.550, 0.660] | 0.870 [0.800, 0.920] |" and rows[-1].startswith("| ceiling")
    assert len(rows) == 4 and "The ceiling is of the 60 of them" in card
    assert "opens 100 mm" in card and "## When not to use it" in card
    assert f"Scale `{PARAMS.scale}` of the workflow" in card
    assert "- 41 objects of source" in card  # that were labelled, not params.yaml's count of those selected
    assert "{" not in card


def test_what_params_say_now_does_not_matter_but_what_was_run(run):
    values = yaml.safe_load(Path("params.yaml").read_text())
    values["gripper"]["opening_mm"] = 55
    Path("params.yaml").write_text(yaml.safe_dump(values))
    assert export().exit_code == 0
    assert config()["gripper"]["opening_mm"] == PARAMS.gripper.opening_mm


@pytest.mark.parametrize(
    "edited", ["reports/desktop/metrics.json", "data/functions/fcn-0.npz", "data/networks/fcn-0/config.json"]
)
def test_metrics_of_another_run_are_left_out(run, edited):
    if edited == "data/functions/fcn-0.npz":  # what evaluate read was another
        lock = yaml.safe_load(Path("dvc.lock").read_text())
        lock["stages"]["predict@fcn-0"]["outs"][0]["md5"] = "0" * 32
        Path("dvc.lock").write_text(yaml.safe_dump(lock))
    else:
        Path(edited).write_text(Path(edited).read_text() + "\n")
    result = export()
    assert result.exit_code == 0 and "without metrics" in result.stdout
    assert config()["metrics"] is None and "Not measured" in Path("out/README.md").read_text()


@pytest.mark.parametrize(
    ("spoil", "arguments", "says"),
    [
        (lambda: Path("dvc.lock").unlink(), [], "dvc.lock: no such file"),
        (lambda: None, ["--network", "resnet-0"], "dvc.lock: says nothing of stage train@resnet-0"),
        (
            lambda: Path("data/networks/fcn-0/weights.safetensors").write_bytes(b""),
            [],
            "data/networks/fcn-0/weights.safetensors: not what train@fcn-0 wrote",
        ),
        (lambda: shutil.rmtree("data/networks"), [], "data/networks/fcn-0/weights.safetensors: No such file"),
        (lambda: Path("out").write_text(""), [], "out: "),
    ],
)
def test_what_no_model_can_be_made_of_is_one_line(run, spoil, arguments, says):
    spoil()
    result = export(*arguments)
    assert result.exit_code == 2 and result.stderr.startswith(says), result.output
    assert result.stderr.count("\n") == 1


def test_meshes_of_others_bring_a_licence(run):
    lock = yaml.safe_load(Path("dvc.lock").read_text())
    lock["stages"]["select_meshes"]["params"]["params.yaml"]["meshes"]["source"] = "ycb"
    Path("dvc.lock").write_text(yaml.safe_dump(lock))
    assert export().stderr.startswith("--licence: missing; the network was trained on meshes of ycb")
    assert export("--licence", "CC-BY-4.0").exit_code == 0
    assert config()["licence"] == "CC-BY-4.0"
