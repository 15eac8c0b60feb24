"""Maps over objects: processes of this machine, or of any running Dask scheduler."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import closing
from typing import Any

from tqdm import tqdm

from graspfn.params import Compute
from graspfn.workflow.child import Died, packed
from graspfn.workflow.pools import ClusterError, pool

__all__ = ["ClusterError", "map_in_order", "map_objects"]

DEATHS = 3  # DART can take its process down; a task of which three processes died is recorded as failed
QUEUE = 3  # tasks per worker in flight: enough to keep it busy, few enough that a long list costs no memory
AHEAD = 10  # tasks per worker that may be done before the one that is asked for next
LOOK_S = 5.0  # between looks at whether there are workers, while no task ends

Task = tuple[str, tuple[Any, ...]]


def map_objects(
    function: Callable[..., Any],
    tasks: Iterable[Task],
    total: int,
    compute: Compute,
    label: str | None,
    hold: Callable[[int], bool] = lambda workers: False,
    parts: int = 1,
    attempts: Callable[[Any], int] | None = None,
) -> Iterator[tuple[str, Any | Exception]]:
    """`function(*arguments)` of every (name, arguments) as each is done, in any order: (name, result or exception).

    Results may not depend on the worker or the order. A task gives an error if three processes died of it: once among
    others, and then twice alone, in processes that did nothing else, so that it was neither an earlier task's doing
    nor for want of memory that others used. ClusterError, if there is nowhere to run tasks.
    `hold` says, of the number of workers, whether no further task may start yet. The progress bar, for which a label of
    None stands for none, counts objects, of `parts` tasks each, and shows how many attempts a second there were where
    `attempts` tells them from a result.
    """
    if total == 0:
        return
    # A bar of whole objects counts them as they are; thirds of objects would show all their digits.
    progress = tqdm(
        total=total / parts, desc=label, disable=label is None, unit="object", smoothing=0.1, unit_scale=parts > 1
    )
    with closing(pool(compute)) as workers, progress as bar:
        waiting = iter(tasks)
        running: dict[Future[bytes], tuple[str, bytes, int]] = {}  # name, task, and the processes that died of it
        suspects: deque[tuple[str, bytes, int]] = deque()

        def submit(name: str, payload: bytes, deaths: int) -> None:
            running[workers.submit(payload, fresh=deaths > 0)] = name, payload, deaths

        def fill() -> None:
            if any(deaths for _, _, deaths in running.values()):
                return  # it is to run alone
            size = max(1, workers.size())  # they come and go
            while len(running) < QUEUE * size and not hold(size):
                task = next(waiting, None)
                if task is None:
                    break
                name, arguments = task
                submit(name, packed(function, arguments), 0)
            if suspects and not running:
                submit(*suspects.popleft())

        def outcome(future: Future[bytes]) -> tuple[str, Any | Exception] | None:
            """A task's name and result; None if it is to run again."""
            name, payload, deaths = running.pop(future)
            try:
                return name, pickle.loads(workers.result(future))
            except Died:
                if deaths + 1 < DEATHS:
                    suspects.append((name, payload, deaths + 1))
                    return None
                return name, RuntimeError(f"{name}: killed its worker process {DEATHS} times")

        done = made = 0
        fill()
        while running:
            ended, _ = wait(running, timeout=LOOK_S, return_when=FIRST_COMPLETED)
            if not ended:
                workers.wait_for_workers()
            for future in ended:
                found = outcome(future)
                if found:
                    done += 1
                    bar.update(done / parts - bar.n)  # sixths that are added up come to more than their objects
                    if attempts and not isinstance(found[1], Exception):
                        made += attempts(found[1])
                        rate = made / max(bar.format_dict["elapsed"], 1e-9)
                        bar.set_postfix_str(f"{rate:.0f} attempts/s", refresh=False)
                    yield found
                fill()


def map_in_order(
    function: Callable[..., Any],
    tasks: Iterable[Task],
    total: int,
    compute: Compute,
    label: str | None,
) -> Iterator[tuple[str, Any | Exception]]:
    """As map_objects, in the order of the tasks. Whoever has enough may stop asking; `total` is for the bar alone."""
    order: deque[str] = deque()
    done: dict[str, Any] = {}

    def far_ahead(workers: int) -> bool:
        return len(order) >= AHEAD * workers

    def noted() -> Iterator[Task]:
        for name, arguments in tasks:
            order.append(name)
            yield name, arguments

    for name, result in map_objects(function, noted(), total, compute, label, hold=far_ahead):
        done[name] = result
        while order and order[0] in done:
            name = order.popleft()
            yield name, done.pop(name)
