"""What every stage script has in common: its parameters, one-line errors, and a note of how long it took."""

from __future__ import annotations

import functools
import json
import sys
import time
from collections.abc import Callable
from typing import Any

from graspfn.params import Declared, load
from graspfn.workflow.files import atomic
from graspfn.workflow.shards import SCRATCH

TIMINGS = SCRATCH / "timings"


def stage(name: str) -> Callable[[Callable[[Declared], None]], Callable[[], None]]:
    """Make `main(params)` the script of a stage of dvc.yaml; of a matrix stage, the script's argument is the network.

    Bad input (a ValueError of our own or a file that is not there) ends it with one line and exit status 1.
    """

    def decorate(main: Callable[[Declared], None]) -> Callable[[], None]:
        @functools.wraps(main)
        def run() -> None:
            network = sys.argv[1] if len(sys.argv) > 1 else None
            started = time.monotonic()
            try:
                main(load(name, network))
            except (ValueError, FileNotFoundError) as error:
                if type(error) is ValueError:  # not one of ours: a bug, which deserves its traceback
                    raise
                sys.exit(f"{name}: {' '.join(str(error).split())}")
            full_name = f"{name}@{network}" if network else name
            with atomic(TIMINGS / f"{full_name}.json") as path:
                path.write_text(json.dumps({"seconds": round(time.monotonic() - started, 1)}))

        return run

    return decorate


def timings() -> dict[str, Any]:
    """Seconds that each stage took when it last ran here, by name."""
    return {path.stem: json.loads(path.read_text())["seconds"] for path in sorted(TIMINGS.glob("*.json"))}
