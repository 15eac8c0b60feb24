"""`graspfn model`: its options; `commands/exporting.py` does the work."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from graspfn.commands.ending import BAD_INPUT, InputError, end_at

model = typer.Typer(no_args_is_help=True, help="Models: a trained network with all that planning with it needs.")


@model.callback()
def _model() -> None:
    """Keeps `export` a command of its own."""


@model.command()
def export(
    out: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder to write: network.onnx, weights, config.json, README.md.")
    ],
    network: Annotated[
        str | None, typer.Option(metavar="NAME-SEED", help="Of data/networks; the best by the report if not given.")
    ] = None,
    licence: Annotated[
        str | None, typer.Option(help="Of the weights, SPDX; MIT if not given, where the objects are our own.")
    ] = None,
) -> None:
    """Make a model of a network that the workflow has trained, with what dvc.lock says it was trained with.

    For example: graspfn model export models/fcn
    """
    from graspfn.commands.exporting import export_model  # torch is slow to import

    try:
        typer.echo(export_model(out, network, licence))
    except InputError as error:
        end_at([str(error)], BAD_INPUT)
