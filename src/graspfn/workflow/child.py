"""Processes that run one task at a time and may die of it: DART, ODE and mesh libraries take theirs down at times.

A death is the fault of the task that ran, of none that waited.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import cloudpickle

from graspfn.workflow.shards import code_digest

STARTS = 3  # tries to start a process that ends before it takes a task
POLL_S = 1.0  # between looks at whether a process still lives, should something it started hold its pipe open
# A process to a core already. The names of sets hash alike in all of them.
ENVIRONMENT = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMBA_NUM_THREADS"), "1"
) | {"PYTHONHASHSEED": "0"}


class Died(RuntimeError):
    """The process of a task ended before the task did."""


class NoStartError(RuntimeError):
    """Processes end before they take a task."""


class OtherCodeError(ImportError):
    """The process would run another version of graspfn."""


def package_digest() -> str:
    """Hash of all of graspfn, as it lies on the disk."""
    return code_digest(".")


class Child:
    """A Python process that runs tasks, one after the other; starting one is left to `hello`."""

    def __init__(self) -> None:
        self._pipe, there = Pipe()
        with there:
            command = f"from graspfn.workflow.child import serve; serve({there.fileno()})"
            self._process = subprocess.Popen(
                [sys.executable, "-c", command],
                env=os.environ
                | ENVIRONMENT
                | {"PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)},
                stdin=subprocess.DEVNULL,
                pass_fds=[there.fileno()],
                start_new_session=True,  # Ctrl-C is for the process that waits, which ends this one
            )
        self.digest = ""

    def hello(self) -> None:
        """Wait until it is ready; Died if it never is."""
        self.digest = self._receive().decode()

    def call(self, payload: bytes) -> bytes:
        """The answer to a task of `packed`; Died."""
        try:
            self._pipe.send_bytes(payload)
        except OSError:
            raise Died from None
        return self._receive()

    def _receive(self) -> bytes:
        try:
            while not self._pipe.poll(POLL_S):
                if not self.alive() and not self._pipe.poll():
                    raise Died
            return self._pipe.recv_bytes()
        except (EOFError, OSError):
            raise Died from None

    def alive(self) -> bool:
        return self._process.poll() is None

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()


class Children:
    """A child for each thread that asks, until closed."""

    def __init__(self) -> None:
        self._children: dict[int, Child] = {}
        self._lock, self._closed = threading.Lock(), False

    def run(self, digest: str, payload: bytes, fresh: bool) -> bytes:
        """The answer to a task of `packed`, from a child that has run nothing else if it is to be `fresh`.

        digest: of the code that whoever asks runs. Died, if the task took the child down; OtherCodeError.
        """
        child = self._child(fresh)
        if child.digest != digest:
            child = self._child(fresh=True)  # the old one may be from before an update
        if child.digest != digest:
            raise OtherCodeError("its code of graspfn is not the one here")
        return child.call(payload)

    def _child(self, fresh: bool) -> Child:
        thread = threading.get_ident()
        child = self._children.get(thread)
        if child and not fresh and child.alive():
            return child
        for _ in range(STARTS):
            with self._lock:
                if child:
                    child.kill()
                if self._closed:
                    raise CancelledError
                child = self._children[thread] = Child()
            with contextlib.suppress(Died):
                child.hello()
                return child
        raise NoStartError(f"{sys.executable} ends before it takes a task, {STARTS} times")

    def close(self) -> None:
        """End all children, whatever they do."""
        with self._lock:
            self._closed = True
            for child in self._children.values():
                child.kill()


def packed(function: Any, arguments: tuple[Any, ...]) -> bytes:
    """A task as a child takes it; by value where its function is of the script that runs."""
    return cloudpickle.dumps((function, arguments))


def alone(function: Callable[..., Any], *arguments: Any) -> Any:
    """`function(*arguments)` in a child of its own, with what it raises; Died, if it takes the child down."""
    with contextlib.closing(Children()) as children:
        answer = pickle.loads(children.run(package_digest(), packed(function, arguments), fresh=True))
    if isinstance(answer, Exception):
        raise answer
    return answer


def _answer(payload: bytes) -> bytes:
    """The pickled result of a task, or the exception that it raised."""
    try:
        function, arguments = pickle.loads(payload)
        return cloudpickle.dumps(function(*arguments))
    except Exception as error:
        try:
            answer = cloudpickle.dumps(error)
            pickle.loads(answer)  # some exceptions pickle, but do not come back
            return answer
        except Exception:
            return pickle.dumps(RuntimeError(f"{type(error).__name__}: {error}"))


def serve(fileno: int) -> None:
    """What a child does: answer the tasks that come through the pipe, and end with whoever holds its other end."""
    os.set_inheritable(fileno, False)
    with contextlib.suppress(OSError):  # should memory run out, Linux ends this process, not the one that waits for it
        Path("/proc/self/oom_score_adj").write_text("1000")
    pipe, tasks = Connection(fileno), queue.SimpleQueue[bytes]()

    def receive() -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                tasks.put(pipe.recv_bytes())
        os._exit(0)

    threading.Thread(target=receive, daemon=True).start()
    pipe.send_bytes(package_digest().encode())
    with contextlib.suppress(BrokenPipeError):
        while True:
            pipe.send_bytes(_answer(tasks.get()))
