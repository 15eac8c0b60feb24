"""dvc.yaml says of every stage exactly what it uses: the rooms it imports and the parameters it reads."""

from __future__ import annotations

import ast
import contextlib
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml
from dvc.repo import Repo

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "graspfn"
PLUMBING = "workflow"  # in no stage's deps: it hands work out and keeps files, and cannot change a result
MODULES = {"params.py", "seeds.py"}  # that rooms may import beside each other
ROOMS = [PLUMBING, "geometry", "meshes", "formats", "selection", "physics", "imaging", "learning", "planning"]
ROOMS += ["evaluation", "robot", "reporting"]
STAGES = yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"]


def imports(path: Path) -> set[Path]:
    """The graspfn modules that a file imports, at its top or inside a function."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    files = set()
    for name in names:
        parts = name.split(".")
        if parts[0] == "graspfn" and len(parts) > 1:
            file = PACKAGE.joinpath(*parts[1:]).with_suffix(".py")
            if file.is_file():
                files.add(file)
    return files


def reached(path: Path) -> set[Path]:
    """Every graspfn module that loading a file can load."""
    seen: set[Path] = set()
    todo = [path]
    while todo:
        new = imports(todo.pop()) - seen
        seen |= new
        todo += new
    return seen


def rooms(files: set[Path]) -> set[str]:
    return {file.relative_to(PACKAGE).parts[0] for file in files if file.parent != PACKAGE}


def used(stage: str) -> set[str]:
    """The rooms and modules whose code can change what a stage writes. Of params.py DVC tracks the values."""
    files = reached(script(stage))
    return (rooms(files) - {PLUMBING}) | {file.name for file in files if file.parent == PACKAGE} - {"params.py"}


def script(stage: str) -> Path:
    return ROOT / "stages" / f"{stage}.py"


def test_every_script_is_a_stage_and_every_stage_a_script() -> None:
    assert {path.stem for path in (ROOT / "stages").glob("*.py")} == set(STAGES)
    for name, stage in STAGES.items():
        assert stage["cmd"].split()[:2] == ["python", f"stages/{name}.py"]


@pytest.mark.parametrize("name", STAGES)
def test_deps_are_the_rooms_that_the_stage_imports(name: str) -> None:
    deps = {dep for dep in STAGES[name]["deps"] if dep.startswith("src/")}
    assert deps == {f"src/graspfn/{room}" for room in used(name)}
    assert f"stages/{name}.py" in STAGES[name]["deps"]


@pytest.mark.parametrize("name", STAGES)
def test_params_are_the_keys_that_the_stage_reads(name: str) -> None:
    tree = ast.parse(script(name).read_text())
    read = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "params"
    }
    # `compute` cannot change a result, `items` are those of the matrix.
    declared = {key.partition(".")[0] for key in STAGES[name].get("params", [])}
    if name != "report":  # hands all of them to the page
        assert read - {"compute", "items"} == declared


@pytest.mark.parametrize("name", STAGES)
def test_a_stage_script_only_wires(name: str) -> None:
    assert len(script(name).read_text().splitlines()) < 100


@pytest.mark.parametrize("room", ROOMS)
def test_rooms_import_only_from_rooms_above(room: str) -> None:
    above = ROOMS[: ROOMS.index(room) + 1]
    for file in (PACKAGE / room).rglob("*.py"):
        used = imports(file)
        assert rooms(used) <= set(above), file
        assert {path.name for path in used if path.parent == PACKAGE} <= MODULES, file


def test_every_room_is_known() -> None:
    assert {path.parent.name for path in PACKAGE.glob("*/__init__.py")} == set(ROOMS)


def test_params_module_computes_nothing_that_stages_would_not_see() -> None:
    assert imports(PACKAGE / "params.py") == set()


LABELS = ("label_grasps@train", "label_grasps@test")


@pytest.fixture(scope="module")
def labelled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project in which everything up to the labels counts as made; its files say nothing."""
    folder = tmp_path_factory.mktemp("labelled")
    for name in ("src/graspfn", "stages", "inputs"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("dvc.yaml", "params.yaml", ".dvcignore", ".dvc/config"):
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    subprocess.run(["git", "init", "-q"], cwd=folder, check=True)
    with contextlib.chdir(folder), Repo() as repo:
        for stage in LABELS:
            for made in repo.stage.collect(stage, with_deps=True):
                for out in made.outs:
                    path = Path(out.fs_path)
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_text(path.name)
            repo.commit(stage, with_deps=True, force=True)
    return folder


def changed(folder: Path) -> set[str]:
    """The stages, of labelling and those before it, that `dvc status` finds changed."""
    with contextlib.chdir(folder), Repo() as repo:
        return {name.rpartition(":")[2] for name in repo.status(list(LABELS), with_deps=True)}


QUIET = "workflow imaging learning planning evaluation robot reporting params.py compose.py cli.py label_mesh.py"
QUIET += " robot_logs.py"


# DVC asks pygtrie for what it will one day no longer give.
@pytest.mark.filterwarnings("ignore:_NoneStep:DeprecationWarning")
@pytest.mark.parametrize(
    ("edited", "stages"),
    [
        ("", set()),
        ("imaging/camera.py imaging/warp.py", set()),
        (QUIET, set()),
        ("formats selection", {"select_meshes"}),
        ("physics/attempt.py", {"place_objects", *LABELS}),
        ("geometry/grid.py", {"place_objects", *LABELS}),
        ("meshes/placed.py", {"select_meshes", "place_objects", *LABELS}),
        ("seeds.py", {"select_meshes", "place_objects", *LABELS}),
    ],
)
def test_labels_depend_on_physics_and_little_else(labelled: Path, edited: str, stages: set[str]) -> None:
    paths = [labelled / "src/graspfn" / name for name in edited.split()]
    files = [file for path in paths for file in ([path] if path.is_file() else sorted(path.rglob("*.py")))]
    assert all(path.exists() for path in paths)
    before = [file.read_text() for file in files]
    for file in files:
        file.write_text(file.read_text() + "\n# edited\n")
    try:
        assert changed(labelled) == stages
    finally:
        for file, text in zip(files, before, strict=True):
            file.write_text(text)


def test_only_quiet_rooms_can_be_edited_without_labels() -> None:
    """Every room and module is in the list of those that leave labels alone, or in what labels are made of."""
    everything = {*ROOMS, *(path.name for path in PACKAGE.glob("*.py") if path.name != "__init__.py")}
    assert everything - set(QUIET.split()) == used("label_grasps") | {"formats", "selection"}
