"""What every stage script has in common: its parameters, one-line errors, and a note of how long it took."""

from __future__ import annotations

import functools
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from graspfn.params import Declared, load
from graspfn.workflow.files import atomic
from graspfn.workflow.shards import SCRATCH

TIMINGS = SCRATCH / "timings"


def stage(name: str) -> Callable[[Callable[[Declared], None]], Callable[[], None]]:
    """Make `main(params)` the script of a stage of dvc.yaml; of a matrix stage, the script's arguments are the items.

    Bad input (a ValueError that graspfn itself raises) ends it with one line and exit status 1.
    """

    def decorate(main: Callable[[Declared], None]) -> Callable[[], None]:
        @functools.wraps(main)
        def run() -> None:
            items = sys.argv[1:]
            started = time.monotonic()
            try:
                main(load(name, *items))
            except ValueError as error:
                if not _ours(error):  # a bug, which deserves its traceback
                    raise
                sys.exit(f"{name}: {' '.join(str(error).split())}")
            full_name = f"{name}@{'-'.join(items)}" if items else name
            with atomic(TIMINGS / f"{full_name}.json") as path:
                path.write_text(json.dumps({"seconds": round(time.monotonic() - started, 1)}))

        return run

    return decorate


def _ours(error: BaseException) -> bool:
    """Whether graspfn itself, and not a library that it calls, raised the error."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return trace is not None and Path(trace.tb_frame.f_code.co_filename).is_relative_to(Path(__file__).parents[1])


def timings() -> dict[str, Any]:
    """Seconds that each stage took when it last ran here, by name."""
    return {path.stem: json.loads(path.read_text())["seconds"] for path in sorted(TIMINGS.glob("*.json"))}
