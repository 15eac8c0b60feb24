"""`graspfn params`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from graspfn.commands.ending import BAD_INPUT, end_at
from graspfn.params import ParameterError


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
        end_at([str(error)], BAD_INPUT)
    except OSError as error:
        end_at([f"params.yaml: cannot be written: {error.strerror}"], BAD_INPUT)
