"""`graspfn logs`: its options; `commands/bags.py` does the work."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from graspfn.commands.ending import BAD_INPUT, end_at
from graspfn.params import read_yaml, validate


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
    from graspfn.commands import bags  # scipy, torch and pandas are slow to import

    try:
        params = validate(read_yaml(Path("params.yaml")))
        gathered = bags.gather(paths)
        again = bags.replanner(params, network) if network else None
        found = gathered.analysed(params, again)
        for reason in found.unused["reason"]:
            typer.echo(f"left out: {reason}", err=True)
        if out is not None:
            bags.write(out, found)
            gathered.explained(out / "failures", found, params, again)
    except ValueError as error:  # ParameterError, RecordingError
        end_at([str(error)], BAD_INPUT)
    except OSError as error:
        end_at([f"--out {out}: cannot be written: {error.strerror}"], BAD_INPUT)
    typer.echo(json.dumps(bags.as_dict(found), indent=1, allow_nan=False) if as_json else bags.text(found))
