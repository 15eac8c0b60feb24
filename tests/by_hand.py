"""Dask schedulers and workers started by hand, as docs/cluster.md says, for tests of the maps over them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

LACKING = "import sys; sys.modules['graspfn'] = None; "  # stands for a machine on which graspfn is not installed
RUN = "from dask.__main__ import main; main()"


@contextmanager
def _process(*command: str, first: str = "", path: Path | None = None) -> Iterator[subprocess.Popen[str]]:
    """`dask COMMAND` in a process group of its own, which does not outlive the block."""
    folders = [str(path or ""), str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
    process = subprocess.Popen(
        [sys.executable, "-c", first + RUN, *command, "--no-dashboard", "--host", "127.0.0.1"],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, folders))},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stderr
    try:
        yield process
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        process.stderr.close()


@contextmanager
def dask_scheduler() -> Iterator[str]:
    """The address of a scheduler without workers."""
    with _process("scheduler", "--port", "0") as process:
        assert process.stderr
        for line in process.stderr:  # it says where it listens
            if "Scheduler at:" in line:
                yield line.split()[-1]
                return


@contextmanager
def dask_worker(scheduler: str, lacks: bool = False, path: Path | None = None) -> Iterator[int]:
    """A worker of one thread, with the graspfn that lies in folder `path`; yields its process id."""
    from distributed import Client  # slow to load, also for the workers of tests that need no Dask

    with Client(scheduler) as client:
        before = len(client.nthreads())
        worker = ("worker", scheduler, "--nthreads", "1", "--no-nanny")
        with _process(*worker, first=LACKING if lacks else "", path=path) as process:
            client.wait_for_workers(before + 1, timeout=60)
            yield process.pid
        while len(client.nthreads()) > before:  # or whoever starts the next one would count this one
            time.sleep(0.05)
