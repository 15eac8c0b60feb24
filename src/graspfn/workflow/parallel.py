"""Maps over objects with Dask: processes of this machine, or any running scheduler."""

from __future__ import annotations

import os
import uuid
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import dask
from distributed import Client, KilledWorker, LocalCluster, as_completed
from tqdm import tqdm

from graspfn.params import Compute

ATTEMPTS_PER_TASK = 3  # DART can take its process down; a task that kills three workers is recorded as failed
AHEAD = 10  # tasks per worker that may be done before the one that is asked for next


class ClusterError(ValueError):
    """No scheduler where there should be one."""


@contextmanager
def cluster(compute: Compute) -> Iterator[Client]:
    """A client of the scheduler at `compute.address`, or of one-thread worker processes here.

    dartpy holds the interpreter lock while it steps, so workers are processes of one thread each.
    """
    with dask.config.set(
        {
            "distributed.scheduler.allowed-failures": ATTEMPTS_PER_TASK - 1,
            "distributed.worker.daemon": True,
            # The statistical profiler takes the interpreter lock a hundred times a second from the thread that steps.
            "distributed.worker.profile.enabled": False,
            "distributed.logging.distributed": "error",
            "distributed.comm.timeouts.connect": "60s",
            "distributed.scheduler.work-stealing": True,
        }
    ):
        if compute.address:
            try:
                client = Client(compute.address)
            except (OSError, ValueError) as error:
                raise ClusterError(f"compute.address: no scheduler at {compute.address} ({error})") from None
            with client:
                yield client
            return
        workers = compute.workers or os.cpu_count() or 1
        with (
            LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
            ) as local,
            Client(local) as client,
        ):
            yield client


def map_objects(
    function: Callable[..., Any],
    tasks: Iterable[tuple[str, tuple[Any, ...]]],
    total: int,
    compute: Compute,
    label: str,
    hold: Callable[[int], bool] = lambda workers: False,
    parts: int = 1,
    attempts: Callable[[Any], int] | None = None,
) -> Iterator[tuple[str, Any | Exception]]:
    """`function(*arguments)` of every (name, arguments) as each is done, in any order: (name, result or exception).

    Results may not depend on the worker or the order. A task that kills its worker three times gives an error: three
    times alone on the cluster, since Dask blames a death on every task that the worker had, waiting ones too.
    `hold` says, of the number of workers, whether no further task may start yet. The progress bar counts objects, of
    `parts` tasks each, and shows how many attempts a second there were where `attempts` tells them from a result.
    """
    if total == 0:
        return
    # A bar of whole objects counts them as they are; thirds of objects would show all their digits.
    progress = tqdm(total=total / parts, desc=label, unit="object", smoothing=0.1, unit_scale=parts > 1)
    with cluster(compute) as client, progress as bar:
        # Three tasks in flight per worker: enough to keep it busy, few enough that a long list costs no memory.
        waiting = iter(tasks)
        running: dict[Any, tuple[str, tuple[Any, ...], bool]] = {}  # with whether it runs alone
        suspects: deque[tuple[str, tuple[Any, ...]]] = deque()
        pending = as_completed(with_results=False)

        def submit(name: str, arguments: tuple[Any, ...], alone: bool) -> None:
            # A key of its own: other calls may be on the same scheduler.
            future = client.submit(function, *arguments, pure=False, key=f"{label}-{name}-{uuid.uuid4().hex}")
            running[future] = name, arguments, alone
            pending.add(future)

        def fill() -> None:
            if any(alone for _, _, alone in running.values()):
                return
            workers = max(1, len(client.nthreads()))  # they come and go
            while len(running) < 3 * workers and not hold(workers):
                task = next(waiting, None)
                if task is None:
                    break
                submit(*task, alone=False)
            if suspects and not running:
                submit(*suspects.popleft(), alone=True)

        done = made = 0
        fill()
        for future in pending:
            name, arguments, alone = running.pop(future)
            try:
                result: Any = future.result()
            except KilledWorker as killed:
                if not alone:
                    suspects.append((name, arguments))
                    fill()
                    continue
                result = RuntimeError(f"{name}: killed its worker process {killed.allowed_failures + 1} times")
            except Exception as error:
                result = error
            done += 1
            bar.update(done / parts - bar.n)  # sixths that are added up come to more than their objects
            if attempts and not isinstance(result, Exception):
                made += attempts(result)
                bar.set_postfix_str(f"{made / max(bar.format_dict['elapsed'], 1e-9):.0f} attempts/s", refresh=False)
            yield name, result
            fill()


def map_in_order(
    function: Callable[..., Any],
    tasks: Iterable[tuple[str, tuple[Any, ...]]],
    total: int,
    compute: Compute,
    label: str,
) -> Iterator[tuple[str, Any | Exception]]:
    """As map_objects, in the order of the tasks. Whoever has enough may stop asking; `total` is for the bar alone."""
    order: deque[str] = deque()
    done: dict[str, Any] = {}

    def far_ahead(workers: int) -> bool:
        return len(order) >= AHEAD * workers

    def noted() -> Iterator[tuple[str, tuple[Any, ...]]]:
        for name, arguments in tasks:
            order.append(name)
            yield name, arguments

    for name, result in map_objects(function, noted(), total, compute, label, hold=far_ahead):
        done[name] = result
        while order and order[0] in done:
            name = order.popleft()
            yield name, done.pop(name)
