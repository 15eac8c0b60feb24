"""Tasks in processes of their own: an engine that takes its process down costs one task, and says how it died."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from tqdm import tqdm

T = TypeVar("T")
PRELOAD = ["graspfn.physics.labelling", "graspfn.selection.selection"]  # loaded once, and inherited by every process


class Died(RuntimeError):
    """A task gave no result: how its process ended, or what it raised."""


def isolated(
    function: Callable[..., T], tasks: Sequence[tuple[Any, ...]], workers: int, label: str, limit_s: float = 3600.0
) -> Iterator[T | Died]:
    """`function(*arguments)` of every task, in the order of the tasks, each in a new process, `workers` at a time."""
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # workers share the cores already
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOAD)

    def alone(arguments: tuple[Any, ...]) -> T | Died:
        receive, send = context.Pipe(duplex=False)
        process = context.Process(target=_answer, args=(send, function, arguments), daemon=True)
        process.start()
        send.close()
        try:
            if not receive.poll(limit_s):
                process.kill()
                return Died(f"stopped after {limit_s:g} s")
            result: T | Died = receive.recv()
        except EOFError:
            process.join()
            return Died(f"died of {signal.Signals(-process.exitcode).name}" if process.exitcode else "no result")
        finally:
            receive.close()
        process.join()
        return result

    with ThreadPoolExecutor(workers) as threads:
        yield from tqdm(threads.map(alone, tasks), total=len(tasks), desc=label, smoothing=0.1)


def finished(names: Iterable[str], results: Iterable[T | Died]) -> Iterator[tuple[str, T]]:
    """Name and result of every task that gave one; the others are told."""
    for name, result in zip(names, results, strict=True):
        if isinstance(result, Died):
            print(f"left out {name}: {result}")
        else:
            yield name, result


def _answer(send: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    try:
        result = function(*arguments)
    except Exception as error:
        result = Died(f"{type(error).__name__}: {' '.join(str(error).split())}")
    send.send(result)
