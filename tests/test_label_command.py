"""`graspfn label`: one mesh of the user's own, labelled, accounted for and drawn."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from PIL import Image
from typer.testing import CliRunner

from graspfn.cli import app
from graspfn.commands.label_mesh import _apart
from graspfn.formats.reading import read_mesh
from graspfn.geometry import grid
from graspfn.geometry.transforms import apply
from graspfn.meshes.errors import MeshError
from graspfn.physics.labelling import ENDS, OUTCOMES
from graspfn.workflow.files import read_npz

ROOT = Path(__file__).parents[1]
SIZE_M = (0.05, 0.03, 0.02)
FILES = {"labels.npz", "account.json", "object.ply", "depth.png", "grasp_function.png"}


def write_params(folder: Path, **overrides: dict) -> None:
    values = yaml.safe_load((ROOT / "params.yaml").read_text())
    for section, some in ({"label": {"attempts": 1}} | overrides).items():
        values[section] |= some
    (folder / "params.yaml").write_text(yaml.safe_dump(values))


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """The current directory: params.yaml with one attempt to a pose, and a block to grasp."""
    write_params(tmp_path)
    trimesh.creation.box(SIZE_M).export(tmp_path / "block.stl")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_block_is_labelled_accounted_for_and_drawn_whatever_the_workers(workplace):
    write_params(workplace, compute={"workers": 2})
    command = [sys.executable, "-c", "from graspfn.cli import main; main()", "label", "block.stl", "--json"]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert ran.returncode == 0, ran.stderr
    told = json.loads(ran.stdout)
    out = workplace / "block-labels"
    assert json.loads((out / "account.json").read_text()) == told
    assert {path.name for path in out.iterdir()} == {Path(file).name for file in told["files"]} == FILES | {"film.png"}
    for name in ("depth.png", "grasp_function.png", "film.png"):
        assert np.asarray(Image.open(out / name).convert("L")).std() > 5

    labels, account = read_npz(out / "labels.npz"), told["account"]
    assert account["attempts"] == sum(account[outcome] for outcome in OUTCOMES) == labels["successes"].size == 8712
    assert account["simulated"] == sum(account[end] for end in ENDS)
    assert account["attempts"] == account["untouched"] + account["collided"] + account["simulated"]
    assert 0 < account["held"] == labels["successes"].sum() == told["poses"]["ever_held"] < account["simulated"]
    assert np.array_equal(labels["q"], grid.poses()) and labels["attempts"] == 1
    assert told["seconds"] > 0 and told["core_seconds"] > 0
    assert told["scale"] == 1 and told["size_m"] == pytest.approx(SIZE_M)
    resting = apply(labels["T_world_object"], read_mesh(out / "object.ply").vertices)
    assert resting[:, 2].min() == pytest.approx(0, abs=1e-5)
    assert resting[:, :2].min(axis=0) == pytest.approx(-resting[:, :2].max(axis=0), abs=1e-5)

    write_params(workplace, compute={"workers": 1})
    again = CliRunner().invoke(app, ["label", "block.stl", "--out", "again/here", "--seed", str(told["seed"])])
    assert again.exit_code == 0, again.stderr
    assert f"culled: touch nothing {account['untouched']:,} " in " ".join(again.stdout.split())
    assert f"simulated {account['simulated']:,} " in " ".join(again.stdout.split())
    assert (workplace / "again/here/labels.npz").read_bytes() == (out / "labels.npz").read_bytes()


def test_what_no_gripper_can_hold_has_no_film(workplace):
    trimesh.creation.box((150, 150, 150)).export(workplace / "crate.obj")
    (workplace / "out").mkdir()
    (workplace / "out" / "film.png").write_bytes(b"of an earlier run")
    write_params(workplace, compute={"workers": 1})
    result = CliRunner().invoke(app, ["label", "crate.obj", "--size", "15", "--out", "out"])
    assert result.exit_code == 0, result.stderr
    assert "15.0 x 15.0 x 15.0 cm" in result.stdout and "8712 poses: 0 ever held" in result.stdout
    assert "no film.png" in result.stdout.splitlines()[-1]
    assert {path.name for path in (workplace / "out").iterdir()} == FILES


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["none.ply"], "none.ply: no such file"),
        (["noise.ply"], "noise.ply: cannot be read as .ply"),
        (["sheet.ply"], "sheet.ply: no volume"),
        (["metres.ply"], "metres.ply: 300 cm long, where it takes 1 to 30; if its unit is not the metre, give --size"),
        (["block.stl", "--size", "0.1"], "block.stl: 0.1 cm long, where it takes 1 to 30"),
        (["block.stl", "--size", "nan"], "block.stl: nan cm long"),
        (["block.stl", "--out", "noise.ply"], "--out noise.ply: cannot be written"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(workplace, arguments, said):
    (workplace / "noise.ply").write_bytes(b"ply of nothing")
    trimesh.Trimesh(
        [[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0], [0.05, 0.2, 0]],
        [[0, 1, 2], [0, 2, 3], [3, 2, 4], [0, 3, 4]],
    ).export(workplace / "sheet.ply")
    trimesh.creation.box((3, 1, 1)).export(workplace / "metres.ply")
    refuses(workplace, arguments, said)


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({"settle": {"limit_s": 0.02}}, "block.stl: never came to rest in 0.02 s"),
        ({"gripper": {"finger_length_mm": 10}, "attempt": {"close_s": 9}}, "gripper.finger_length_mm"),
        ({"physics": {"time_step_ms": -1}}, "physics.time_step_ms"),
    ],
)
def test_parameters_that_cannot_be_are_one_line(workplace, overrides, said):
    write_params(workplace, **overrides)
    refuses(workplace, ["block.stl"], said)


def dies(path: Path) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def test_a_library_that_crashes_on_a_mesh_costs_a_line():
    with pytest.raises(MeshError, match=r"^caf\\udce9\.stl: the process that cleaned and settled it died"):
        _apart(dies, Path("caf\udce9.stl"))


def test_params_yaml_is_asked_for(workplace):
    (workplace / "params.yaml").unlink()
    refuses(workplace, ["block.stl"], "params.yaml: no such file")


def refuses(workplace: Path, arguments: list[str], said: str) -> None:
    before = sorted(workplace.rglob("*"))
    result = CliRunner().invoke(app, ["label", *arguments])
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.count("\n") == 1 and said in result.stderr
    assert sorted(workplace.rglob("*")) == before
