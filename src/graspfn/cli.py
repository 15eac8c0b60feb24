"""`graspfn`: registers the commands. DVC runs the workflow."""

from __future__ import annotations

import importlib.metadata
from typing import Annotated

import typer

from graspfn.commands.check import check
from graspfn.commands.ending import BAD_INPUT, LACKS_WORKFLOW
from graspfn.commands.label import label
from graspfn.commands.logs import logs
from graspfn.commands.model import model
from graspfn.commands.params import params
from graspfn.commands.plan import plan
from graspfn.commands.serve import serve
from graspfn.commands.trial import trial

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
    """Parameters, checks, one mesh's labels, grasps for depth images, recordings; `dvc repro` runs the workflow."""


for command in (params, check, label, plan, serve, trial, logs):
    app.command()(command)
app.add_typer(model, name="model")


def main() -> None:
    try:
        app()
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] == __package__:
            raise
        typer.echo(f"{error.name}: {LACKS_WORKFLOW}", err=True)
        raise SystemExit(BAD_INPUT) from None
