"""Whoever edits params.yaml by hand and types `dvc repro` loses no file of a folder that params.yaml names."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from graspfn.cli import app

ROOT = Path(__file__).parents[1]


def dvc(folder, *arguments):
    env = os.environ | {"PYTHONPATH": str(folder / "src"), "PYTHONDONTWRITEBYTECODE": "1", "CI": "true"}
    command = ["dvc", *arguments]
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, timeout=300, check=False)


def edit(folder, **changes):
    values = yaml.safe_load((folder / "params.yaml").read_text(encoding="utf-8"))
    for section, keys in changes.items():
        values[section] |= keys
    (folder / "params.yaml").write_text(yaml.safe_dump(values), encoding="utf-8")


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """The project, as the current directory; trials of the user's own lie in the outputs of two stages."""
    for name in ("src", "stages", "inputs"):
        (tmp_path / name).symlink_to(ROOT / name)
    for name in ("dvc.yaml", "params.yaml"):
        shutil.copy(ROOT / name, tmp_path)
    for name in ("data/recordings", "data/objects/test"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "mine.mcap").write_text("an afternoon's work")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def repository(workplace):
    assert dvc(workplace, "init", "--no-scm", "--quiet").returncode == 0
    return workplace


@pytest.mark.parametrize(
    ("folder", "arguments"),
    [
        ("data/objects/test", ["repro", "select_meshes"]),  # without check_inputs, DVC sees no harm in either
        ("link to data/objects/test", ["repro", "select_meshes"]),
        ("link to data/recordings", ["repro", "--single-item", "record_robot"]),
        ("data/recordings", ["repro", "--single-item", "record_robot"]),
    ],
)
def test_repro_removes_no_recordings(repository, folder, arguments):
    if target := folder.partition("link to ")[2]:
        folder = "link"
        (repository / folder).symlink_to(target)
    edit(repository, robot={"source": "folder", "folder": folder}, meshes={"train": 1, "test": 1})
    assert dvc(repository, *arguments).returncode != 0
    for name in ("data/recordings", "data/objects/test"):
        assert (repository / name / "mine.mcap").read_text() == "an afternoon's work"


def test_folders_with_odd_names_are_watched(repository):
    """`#1`, `o'neil` and the like reach DVC, and come back from dvc.lock, as they are."""
    shutil.rmtree(repository / "data")
    folders = {"meshes": 'Größe, #1 (a=b) {c} [d] "e"', "robot": "o'neil\\ 1e3: & *"}
    for section, folder in folders.items():
        (repository / folder).mkdir()
        (repository / folder / "file").touch()
        edit(repository, **{section: {"folder": folder}})
    done = dvc(repository, "repro", "check_inputs")
    assert done.returncode == 0, done.stderr
    lock = yaml.safe_load((repository / "dvc.lock").read_text(encoding="utf-8"))
    assert set(folders.values()) <= {dep["path"] for dep in lock["stages"]["check_inputs"]["deps"]}
    assert "up to date" in dvc(repository, "status", "check_inputs").stdout


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ({"meshes": {"source": "folder", "folder": "none"}}, ["none: no such file or folder; meshes.folder takes"]),
        ({"meshes": {"source": "folder", "folder": "empty"}}, ["empty: no mesh in it; meshes.folder takes"]),
        (
            {"meshes": {"source": "modelnet40", "folder": "none.zip"}},
            ["none.zip: no such file or folder; meshes.folder"],
        ),
        ({"meshes": {"folder": "none"}}, ["meshes.folder: none: no such file or folder; DVC watches it"]),
        ({"robot": {"folder": "none"}}, ["robot.folder: none: no such file or folder; DVC watches it"]),
        ({"robot": {"source": "folder", "folder": "none"}}, ["none: no .mcap files; robot.folder takes"]),
        (
            {"meshes": {"source": "folder", "folder": "empty"}, "robot": {"source": "folder", "folder": "empty"}},
            ["empty: no mesh in it; meshes.folder takes", "empty: no .mcap files; robot.folder takes"],
        ),
        ({"robot": {"folder": "data/recordings"}}, ["robot.folder: 'data/recordings' shares files with"]),
    ],
)
def test_check_says_which_folder_cannot_be_used(workplace, monkeypatch, changes, lines):
    monkeypatch.setattr("graspfn.commands.check._loads", lambda library: True)
    (workplace / "empty").mkdir()
    edit(workplace, **changes)
    result = CliRunner().invoke(app, ["check"])
    assert result.exit_code == 1
    found = result.stderr.splitlines()
    assert len(found) == len(lines)
    for line, start in zip(found, lines, strict=True):
        assert line.startswith(start)
