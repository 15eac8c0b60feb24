"""Where tasks run: in children of this process, or of the workers of a running Dask scheduler."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from typing import Any

from tqdm import tqdm

from graspfn.params import Compute
from graspfn.workflow.child import Children, Died, NoStartError, OtherCodeError, package_digest
from graspfn.workflow.cores import cores

CHILDREN = Children()  # of this process, where it is a Dask worker


class ClusterError(ValueError):
    """No scheduler or no workers where there should be some, or workers that run other code."""


class LocalPool:
    """`size` children of this process, of one thread each; dartpy holds the interpreter lock while it steps."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._digest, self._children, self._threads = package_digest(), Children(), ThreadPoolExecutor(size)

    def size(self) -> int:
        """How many tasks may run at once now."""
        return self._size

    def submit(self, payload: bytes, fresh: bool) -> Future[bytes]:
        """Have a task of `packed` done, in a process that did nothing before if `fresh`."""
        return self._threads.submit(self._children.run, self._digest, payload, fresh)

    def result(self, future: Future[bytes]) -> bytes:
        """What became of a task; Died if it took its process down, ClusterError if no task can be done."""
        try:
            return future.result()
        except NoStartError as error:
            raise ClusterError(f"compute.workers: {error}") from None
        except OtherCodeError:
            raise ClusterError("the code of graspfn was changed since this began; start it again") from None

    def wait_for_workers(self) -> None:
        """Called at times while no task ends."""

    def close(self) -> None:
        """End all tasks, whatever they do."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        self._children.close()
        self._threads.shutdown()


class DaskPool:
    """The workers of a scheduler, which has a child for each of its threads; they come and go. As LocalPool."""

    def __init__(self, address: str) -> None:
        from distributed import Client  # slow to load, and only needed here

        for logger in ("distributed", "distributed.client"):
            logging.getLogger(logger).setLevel(logging.CRITICAL)  # what goes wrong is said here, in a line
        self._address, self._digest, self._told = address, package_digest(), False
        try:
            self._client = Client(address)
        except (OSError, ValueError) as error:
            raise ClusterError(f"compute.address: no scheduler at {address} ({error})") from None
        self._executor = self._client.get_executor(pure=False)
        self._run = _on_worker()

    def size(self) -> int:
        try:
            return sum(self._client.nthreads().values())
        except OSError:
            raise self._gone() from None

    def submit(self, payload: bytes, fresh: bool) -> Future[bytes]:
        return self._executor.submit(self._run, self._digest, payload, fresh)

    def result(self, future: Future[bytes]) -> bytes:
        from distributed import KilledWorker
        from distributed.scheduler import NoValidWorkerError

        try:
            return future.result()
        except KilledWorker:  # whole workers died, and it is not known of what
            raise Died from None
        except ImportError as error:
            raise ClusterError(
                f"compute.address: {error}; install the graspfn of this machine there, and start that worker again"
            ) from None
        except NoValidWorkerError:
            raise ClusterError(f"compute.address: the scheduler at {self._address} has no worker left") from None
        except CancelledError:
            raise self._gone() from None

    def wait_for_workers(self) -> None:
        """They may be on their way; it is the scheduler that knows for how long to wait (no-workers-timeout)."""
        missing = self.size() == 0
        if missing and not self._told:
            tqdm.write(f"compute.address: no worker at {self._address}; waiting for one", file=sys.stderr)
        self._told = missing

    def close(self) -> None:
        self._executor.shutdown(wait=False)
        self._client.close()

    def _gone(self) -> ClusterError:
        return ClusterError(f"compute.address: the scheduler at {self._address} is gone")


def pool(compute: Compute) -> LocalPool | DaskPool:
    """The pool that `compute` asks for; ClusterError."""
    return DaskPool(compute.address) if compute.address else LocalPool(compute.workers or cores())


def _on_worker() -> Callable[[str, bytes, bool], Any]:
    """`Children.run` on a Dask worker.

    Made here, it travels by value, so that a worker without graspfn can say that it has none.
    """

    def run(digest: str, payload: bytes, fresh: bool) -> bytes:
        from distributed import get_worker

        try:
            from graspfn.workflow.pools import CHILDREN

            return CHILDREN.run(digest, payload, fresh)
        except Exception as error:
            if type(error).__name__ == "Died":
                raise
            raise ImportError(f"worker {get_worker().address}: {error}") from None

    return run
