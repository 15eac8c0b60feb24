"""The loop of long stages: every object's result is a shard, so that a killed stage goes on where it was."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from graspfn.params import Compute
from graspfn.workflow.files import read_npz, write_npz
from graspfn.workflow.parallel import map_objects
from graspfn.workflow.shards import sweep

Arrays = dict[str, np.ndarray]


class FailedObjectsError(ValueError):
    """Too many objects failed for what is left to mean anything."""


def each_object(
    stage: str,
    shards: Mapping[str, Path],
    function: Callable[..., Any],
    tasks: Callable[[str], Sequence[tuple[Any, ...]]],
    pack: Callable[[list[Any]], Arrays],
    compute: Compute,
    max_failed: float,
    parts: int = 1,
    attempts: Callable[[Any], int] | None = None,
) -> tuple[dict[str, Arrays], dict[str, str]]:
    """Arrays of every object by name, and of those that failed the reason.

    shards: where each object's arrays are kept. An object that has none yet is made of `parts` results of `function`,
    one for each of tasks(name), in their order; `pack` turns them into arrays. Shards of other runs are removed.
    FailedObjectsError where more than the share `max_failed` fails; what was made is kept.
    """
    todo = [name for name, path in shards.items() if not path.exists()]
    if len(todo) < len(shards):
        print(f"{len(shards) - len(todo)} of {len(shards)} objects were done before")
    made: dict[str, dict[int, Any]] = {name: {} for name in todo}
    failed: dict[str, str] = {}
    numbered = ((f"{name}/{i}", task) for name in todo for i, task in enumerate(tasks(name)))
    for task, result in map_objects(
        function, numbered, len(todo) * parts, compute, stage, parts=parts, attempts=attempts
    ):
        name, _, part = task.rpartition("/")
        if isinstance(result, Exception):
            failed.setdefault(name, str(result))
            continue
        made[name][int(part)] = result
        if len(made[name]) == parts:
            write_npz(shards[name], pack([one for _, one in sorted(made.pop(name).items())]))
    for name, reason in failed.items():
        print(f"left out {name}: {reason}")
    if len(failed) > max_failed * len(shards):
        name, reason = next(iter(failed.items()))
        raise FailedObjectsError(f"{len(failed)} of {len(shards)} objects failed; the first, {name}: {reason}")
    sweep(stage, shards.values())
    return {name: read_npz(path) for name, path in shards.items() if name not in failed}, failed


def lines_of_each(
    stage: str,
    shards: Mapping[str, Path],
    function: Callable[..., Sequence[Any]],
    task: Callable[[str], tuple[Any, ...]],
    compute: Compute,
    max_failed: float,
) -> pd.DataFrame:
    """As `each_object`, where `function` makes of an object lines of a table, dataclasses: the lines of all objects."""

    def packed(parts: list[Sequence[Any]]) -> Arrays:
        return {str(name): np.array(column.tolist()) for name, column in pd.DataFrame(parts[0]).items()}

    done, _ = each_object(stage, shards, function, lambda name: [task(name)], packed, compute, max_failed)
    return pd.concat([pd.DataFrame(arrays) for arrays in done.values()], ignore_index=True)
