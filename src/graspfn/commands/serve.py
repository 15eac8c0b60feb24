"""`graspfn serve`: its options; `commands/served.py` does the work."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from graspfn.commands.ending import BAD_INPUT, InputError, end_at


def serve(
    model: Annotated[
        Path | None, typer.Option(metavar="MODEL", help="Its folder, or the name of one that comes along.")
    ] = None,
    host: Annotated[str, typer.Option(help="Address to listen on; who reaches it may ask for grasps.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="0: a free one.")] = 8765,
) -> None:
    """Plan grasps over HTTP: POST a depth image to /plan and get the JSON of `graspfn plan`. Takes graspfn[serve].

    For example: graspfn serve --model models/fcn; then http://127.0.0.1:8765/docs
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # requests are planned side by side
    try:
        from graspfn.commands import planned, served  # what plans is slow to import

        served.run(planned.checked_model(model), host, port)
    except ModuleNotFoundError as error:
        end_at([f"graspfn serve: no module {error.name}; pip install 'graspfn[serve]'"], BAD_INPUT)
    except InputError as error:
        end_at([str(error)], BAD_INPUT)
