"""What planning needs and no more: the modules it loads, the Python it runs on, the model that comes with it."""

from __future__ import annotations

import importlib.metadata
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from test_plan_command import DEPTH, PINHOLE, SIGMA, write_mcap, write_pcd

ROOT = Path(__file__).parents[1]
WORKFLOW = {"torch", "dvc", "dartpy", "dask", "distributed", "pandas", "numba", "llvmlite", "trimesh", "hydra", "onnx"}
WORKFLOW |= {"pyarrow", "safetensors", "jinja2", "moderngl", "mujoco"}


@pytest.fixture(scope="module")
def loaded(tmp_path_factory) -> dict[str, str]:
    """Every module, and its file, that a process has which plans on an image of each kind and draws."""
    folder = tmp_path_factory.mktemp("plan")
    np.save(folder / "d.npy", DEPTH)
    write_mcap(folder / "d.mcap")
    write_pcd(folder / "d.pcd", "binary")
    np.savetxt(folder / "eye.txt", np.eye(4))
    frames = ["--robot-from-gripper", "eye.txt", "--gripper-from-camera", "eye.txt"]
    options = ["d.npy", "d.mcap", "d.pcd", *PINHOLE, *SIGMA, "--figure", "plan.png", *frames, "--json"]
    code = f"""
import json, sys
from graspfn.cli import app
status = app(["plan", *{options!r}], standalone_mode=False)
print(json.dumps({{name: str(getattr(module, "__file__", "")) for name, module in list(sys.modules.items())}}))
sys.exit(status)
"""
    ran = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, ""), ran.stderr
    *lines, modules = ran.stdout.splitlines()
    assert len(lines) == 3 and all("robust_score" in json.loads(line) for line in lines)
    return json.loads(modules)


def test_planning_loads_nothing_of_the_workflow(loaded):
    assert not {name.partition(".")[0] for name in loaded} & WORKFLOW


def test_importing_the_planner_loads_what_planning_takes_and_no_more():
    code = "import sys, graspfn.planning.planner; print(*sys.modules)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {name.partition(".")[0] for name in ran.stdout.split()} & (
        WORKFLOW | {"matplotlib", "PIL", "mcap", "typer"}
    )


def test_what_planning_loads_runs_on_the_oldest_python_that_pyproject_takes(loaded):
    oldest = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["requires-python"].removeprefix(">=")
    files = [file for name, file in loaded.items() if name.partition(".")[0] == "graspfn"]
    assert len(files) > 40
    command = [
        sys.executable,
        "-c",
        "import vermin; vermin.main()",
        "--no-tips",
        "--violations",
        f"--target={oldest}-",
        *files,
    ]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout


def test_what_planning_imports_is_a_dependency_without_an_extra(loaded):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    names = {canonicalize_name(Requirement(wanted).name) for wanted in project["dependencies"]}
    texts = [Path(file).read_text() for name, file in loaded.items() if name.partition(".")[0] == "graspfn"]
    imported = {name for text in texts for name in re.findall(r"^(?:import|from) (\w+)", text, re.MULTILINE)}
    packages = importlib.metadata.packages_distributions()
    others = imported - sys.stdlib_module_names - {"graspfn"}
    assert {canonicalize_name(packages[name][0]) for name in others} <= names
