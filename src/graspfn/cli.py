"""`graspfn`: composing params.yaml, checking what the workflow needs, one mesh, folders of bags. DVC runs the rest."""

from __future__ import annotations

import ctypes
import importlib.metadata
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from graspfn.params import ParameterError, check_folders, read_yaml, validate

# Loaded by name, so that a missing one is told before dartpy or moderngl is imported and fails at length.
# Debian's names; libgl1 brings libX11, which dartpy loads as well.
DART_LIBRARY = ("libGL.so.1", "libgl1", "dartpy")
OPENGL_LIBRARY = ("libEGL.so.1", "libegl1", "camera.renderer: opengl")

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, no_args_is_help=True)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"graspfn {importlib.metadata.version('graspfn')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")] = (
        False
    ),
) -> None:
    """Parameters, checks, the labels of one mesh, the recordings of a robot; `dvc repro` runs the workflow."""


@app.command()
def params(
    overrides: Annotated[list[str] | None, typer.Argument(metavar="[GROUP=CHOICE | KEY=VALUE]...")] = None,
) -> None:
    """Write params.yaml from conf/.

    For example: graspfn params scale=smoke gripper.opening_mm=85
    """
    from graspfn.compose import compose, render  # Hydra and pandas are slow to import, and only needed here
    from graspfn.workflow.files import atomic

    try:
        text = render(compose(overrides or []))
        with atomic(Path("params.yaml")) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except ParameterError as error:
        _end_at([str(error)], 2)
    except OSError as error:
        _end_at([f"params.yaml: cannot be written: {error.strerror}"], 2)


@app.command()
def check() -> None:
    """Say, a line each, what is wrong with params.yaml and its folders, and which system libraries are missing."""
    _end_at(_problems() or _folder_problems(), 1)


@app.command()
def label(
    mesh: Annotated[Path, typer.Argument(help="A .off .obj .stl .ply .glb or .gltf file, in metres.", metavar="MESH")],
    out: Annotated[Path | None, typer.Option(help="Folder to write to; ./NAME-labels if not given.")] = None,
    seed: Annotated[
        int | None, typer.Option(help="Of the drop and the attempts; that of params.yaml if not given.")
    ] = None,
    size: Annotated[float | None, typer.Option(metavar="CM", help="Scale the mesh to this largest extent.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the account as JSON.")] = False,
) -> None:
    """Settle and label one mesh with the physics of params.yaml.

    For example: graspfn label mug.stl --size 10
    """
    _end_at(_problems(), 2)
    from graspfn.label_mesh import label_mesh, table  # DART is slow to import, and may not load
    from graspfn.meshes.errors import MeshError
    from graspfn.workflow.parallel import ClusterError

    params = validate(read_yaml(Path("params.yaml")))
    out, seed = out or Path(f"{mesh.stem}-labels"), params.seed if seed is None else seed
    try:
        account = label_mesh(mesh, out, params, seed, size)
    except (ParameterError, MeshError, ClusterError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(2) from None
    typer.echo(json.dumps(account) if as_json else table(account))


@app.command()
def trial(
    bag: Annotated[Path, typer.Argument(help="A .mcap or .db3 file, or the folder of a bag.", metavar="BAG")],
    changes: Annotated[list[str] | None, typer.Argument(metavar="[KEY=VALUE]...")] = None,
) -> None:
    """Write what a trial was into BAG.trial.yaml, and print all that it says; KEY= takes a key out.

    For example: graspfn trial cup-3.mcap object=cup placement=3 method="Best Grasp" network=fcn verdict=held
    """
    from graspfn.robot.described import describe, undescribed
    from graspfn.robot.trial import RecordingError

    pairs = [change.partition("=") for change in changes or []]
    _end_at([f"{key}: takes KEY=VALUE" for key, equals, _ in pairs if not equals], 2)
    try:
        said = describe(bag, {key: value for key, _, value in pairs})
    except RecordingError as error:
        _end_at([str(error)], 2)
    except OSError as error:
        _end_at([f"{bag}.trial.yaml: cannot be written: {error.strerror}"], 2)
    for key, value in said.items():
        typer.echo(f"{key}: {value}")
    for line in undescribed(bag, said):
        typer.echo(line, err=True)


@app.command()
def logs(
    paths: Annotated[list[Path], typer.Argument(help="Folders of bags, or bags.", metavar="PATH...")],
    out: Annotated[Path | None, typer.Option(help="Folder to write the tables and Sigma to.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print all as JSON.")] = False,
    network: Annotated[
        list[str] | None, typer.Option(help="NAME=FOLDER of a network, to plan again with.", metavar="NAME=FOLDER")
    ] = None,
) -> None:
    """Table 2 and the pose uncertainty of recordings, with the topics and frames of params.yaml.

    For example: graspfn logs bags/monday bags/tuesday --out results
    """
    from graspfn import robot_logs  # scipy, torch and pandas are slow to import

    try:
        params = validate(read_yaml(Path("params.yaml")))
        bags = robot_logs.gather(paths)
        again = robot_logs.replanner(params, network) if network else None
        found = bags.analysed(params.topics, params.arm)
        for reason in found.unused["reason"]:
            typer.echo(f"left out: {reason}", err=True)
        differs = robot_logs.replan(found, bags, params, again) if again else {}
        for file, line in differs.items():
            typer.echo(f"{file}: {line}", err=True)
        if out is not None:
            robot_logs.write(out, found)
            robot_logs.write_failures(out, found, bags, params, again, differs)
    except ValueError as error:  # ParameterError, RecordingError
        _end_at([str(error)], 2)
    except OSError as error:
        _end_at([f"--out {out}: cannot be written: {error.strerror}"], 2)
    typer.echo(json.dumps(robot_logs.as_dict(found), indent=1, allow_nan=False) if as_json else robot_logs.text(found))


def _problems() -> list[str]:
    """What is wrong with params.yaml and which system libraries are missing."""
    problems = []
    libraries = [DART_LIBRARY]
    try:
        if validate(read_yaml(Path("params.yaml"))).camera.renderer == "opengl":
            libraries.append(OPENGL_LIBRARY)
    except ParameterError as error:
        problems.append(str(error))
    problems += [
        f"{file}: not found; {user} needs it: apt-get install {package}"
        for file, package, user in libraries
        if not _loads(file)
    ]
    return problems


def _folder_problems() -> list[str]:
    """Which folders of the user's own files cannot be used, in the words of the stages that would read them."""
    params = validate(read_yaml(Path("params.yaml")))
    checks: list[Callable[[], object]] = [lambda: check_folders(params)]
    if params.meshes.source in ("folder", "modelnet40"):
        from graspfn.selection.sources import source_of  # trimesh is slow to import

        checks.append(lambda: source_of(params.meshes))
    else:
        checks.append(lambda: _watched("meshes.folder", params.meshes.folder))
    if params.robot.source == "folder":
        from graspfn.robot.described import read_table
        from graspfn.robot.read import recordings

        checks += [lambda: recordings(Path(params.robot.folder)), lambda: read_table(Path(params.robot.folder))]
    else:
        checks.append(lambda: _watched("robot.folder", params.robot.folder))
    problems = []
    for check in checks:
        try:
            check()
        except ValueError as error:  # ParameterError, MeshError, RecordingError
            problems.append(str(error))
    return problems


def _watched(key: str, folder: str) -> None:
    if not Path(folder).exists():
        raise ParameterError(f"{key}: {folder}: no such file or folder; DVC watches it even where it is not used")


def _end_at(problems: list[str], status: int) -> None:
    """Print problems, if there are any, and end with an exit status."""
    for problem in problems:
        typer.echo(problem, err=True)
    if problems:
        raise typer.Exit(status)


def _loads(library: str) -> bool:
    """Whether the dynamic linker finds a library; elsewhere than on Linux the wheels bring their own."""
    if sys.platform != "linux":
        return True
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def main() -> None:
    app()
