"""`graspfn`: composing params.yaml and checking what the workflow needs. DVC runs the workflow itself."""

from __future__ import annotations

import ctypes
import importlib.metadata
import sys
from pathlib import Path
from typing import Annotated

import typer

from graspfn.params import ParameterError, read_yaml, validate

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
    """Parameters and checks; `dvc repro` runs the workflow."""


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
    except ParameterError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(2) from None
    with atomic(Path("params.yaml")) as temporary:
        temporary.write_text(text)


@app.command()
def check() -> None:
    """Say, a line each, what is wrong with params.yaml and which system libraries are missing."""
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
    for problem in problems:
        typer.echo(problem, err=True)
    if problems:
        raise typer.Exit(1)


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
