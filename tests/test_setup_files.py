"""The files that set a machine up: the lock, the checks, DVC's configuration."""

import configparser
import ctypes
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from typer.testing import CliRunner

from graspfn.cli import app

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LOCK = [line for line in (ROOT / "requirements.lock").read_text().splitlines() if not line.startswith("#")]
WANTED = [wanted for some in (PROJECT["dependencies"], *PROJECT["optional-dependencies"].values()) for wanted in some]


def test_lock_holds_versions_and_nothing_else():
    for line in LOCK:
        assert re.fullmatch(r"[A-Za-z0-9._-]+==[0-9][0-9A-Za-z.]*", line), line
    assert len({canonicalize_name(line.partition("==")[0]) for line in LOCK}) == len(LOCK)


@pytest.mark.parametrize("wanted", WANTED)
def test_lock_satisfies_pyproject(wanted):
    wanted = Requirement(wanted)
    locked = {canonicalize_name(name): version for name, _, version in (line.partition("==") for line in LOCK)}
    assert wanted.specifier.contains(locked[canonicalize_name(wanted.name)])


def test_dvc_never_composes_conf_and_reports_nothing():
    # DVC indents its sections; configparser would read that as continuation lines
    config = configparser.ConfigParser()
    config.read_string("\n".join(line.strip() for line in (ROOT / ".dvc/config").read_text().splitlines()))
    assert not config.getboolean("hydra", "enabled")
    assert not config.getboolean("core", "analytics")
    assert not config.getboolean("core", "autostage")


def test_make_test_runs_what_the_hooks_run():
    hooks = [
        hook["entry"]
        for repo in yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
        for hook in repo["hooks"]
    ]
    recipe = re.search(r"^test: setup\n((\t.*\n)+)", (ROOT / "Makefile").read_text(), re.MULTILINE)[1]
    lines = [line.strip().removesuffix(" $(CODE)") for line in recipe.splitlines()]
    assert [line for line in lines if line in hooks] == hooks


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """A directory with the repository's params.yaml and the folders that it names, as the current one."""
    shutil.copy(ROOT / "params.yaml", tmp_path)
    (tmp_path / "inputs").symlink_to(ROOT / "inputs")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def without(monkeypatch):
    """Hides a system library from the dynamic linker."""

    def hide(*libraries):
        def load(name):
            if name in libraries:
                raise OSError(f"{name}: cannot open shared object file")

        monkeypatch.setattr(ctypes, "CDLL", load)
        monkeypatch.setattr(sys, "platform", "linux")

    return hide


def test_check_is_silent_where_all_is_well(workplace, without):
    without()
    result = CliRunner().invoke(app, ["check"])
    assert (result.exit_code, result.output) == (0, "")


def test_check_names_the_package_of_a_missing_library(workplace, without):
    without("libGL.so.1", "libEGL.so.1")
    result = CliRunner().invoke(app, ["check"])
    assert result.exit_code == 1
    assert result.stderr == "libGL.so.1: not found; dartpy needs it: apt-get install libgl1\n"


def test_check_asks_for_egl_where_the_renderer_needs_it(workplace, without):
    without("libEGL.so.1")
    file = workplace / "params.yaml"
    file.write_text(file.read_text().replace("renderer: embree", "renderer: opengl"))
    result = CliRunner().invoke(app, ["check"])
    assert result.exit_code == 1
    assert result.stderr == "libEGL.so.1: not found; camera.renderer: opengl needs it: apt-get install libegl1\n"


def test_check_gives_every_problem_a_line(workplace, without):
    without("libGL.so.1")
    (workplace / "params.yaml").write_text("seed: -1\n")
    result = CliRunner().invoke(app, ["check"])
    assert result.exit_code == 1
    assert [line.partition(":")[0] for line in result.stderr.splitlines()] == ["scale", "libGL.so.1"]


def test_check_imports_nothing_that_needs_the_libraries():
    heavy = {"dartpy", "torch", "trimesh", "moderngl", "numpy", "hydra", "scipy", "cv2", "onnxruntime", "pandas", "PIL"}
    code = f"import sys, graspfn.cli; sys.exit(len({heavy!r} & set(sys.modules)))"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("command", ["check", "label", "model", "params", "plan"])
def test_a_command_loads_nothing_of_another(command):
    code = f"import sys, graspfn.commands.{command}; print(*sys.modules)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name for name in ran.stdout.split() if name.startswith("graspfn.")}
    shared = {"graspfn.commands", "graspfn.commands.ending", "graspfn.commands.check", "graspfn.params"}
    assert loaded <= shared | {f"graspfn.commands.{command}"}


def test_version_is_the_projects():
    result = CliRunner().invoke(app, ["--version"])
    assert (result.exit_code, result.output) == (0, f"graspfn {PROJECT['version']}\n")
