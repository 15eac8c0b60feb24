"""`graspfn trial`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from graspfn.commands.ending import BAD_INPUT, end_at


def trial(
    bag: Annotated[Path, typer.Argument(help="A .mcap or .db3 file, or the folder of a bag.", metavar="BAG")],
    changes: Annotated[list[str] | None, typer.Argument(metavar="[KEY=VALUE]...")] = None,
) -> None:
    """Write what a trial was into BAG.trial.yaml, and print all that it says; KEY= takes a key out.

    For example: graspfn trial cup-3.mcap object=cup placement=3 method="Best Grasp" network=fcn verdict=held
    """
    from graspfn.robot.described import describe, undescribed  # what reads bags is slow to import
    from graspfn.robot.trial import RecordingError

    pairs = [change.partition("=") for change in changes or []]
    end_at([f"{key}: takes KEY=VALUE" for key, equals, _ in pairs if not equals], BAD_INPUT)
    try:
        said = describe(bag, {key: value for key, _, value in pairs})
    except RecordingError as error:
        end_at([str(error)], BAD_INPUT)
    except OSError as error:
        end_at([f"{bag}.trial.yaml: cannot be written: {error.strerror}"], BAD_INPUT)
    for key, value in said.items():
        typer.echo(f"{key}: {value}")
    for line in undescribed(bag, said):
        typer.echo(line, err=True)
