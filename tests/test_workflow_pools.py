"""Tasks that take their process down, and schedulers and workers that are not what they should be."""

from __future__ import annotations

import gc
import itertools
import os
import random
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import dask.config
import psutil
import pytest
from by_hand import dask_scheduler, dask_worker

import graspfn
from graspfn.params import Compute
from graspfn.workflow import pools
from graspfn.workflow.parallel import map_in_order, map_objects
from graspfn.workflow.pools import ClusterError

# Dask leaves sockets to the garbage collector.
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

DEATHS: dict[str, Callable[[], Any]] = {
    "SIGSEGV": lambda: os.kill(os.getpid(), signal.SIGSEGV),
    "SIGKILL": lambda: os.kill(os.getpid(), signal.SIGKILL),  # as when memory runs out
    "SIGABRT": os.abort,
    "exit": lambda: os._exit(0),
}


def compute(workers: int = 0, address: str | None = None) -> Compute:
    return Compute(address=address, workers=workers, device="cpu", checkpoint_s=60.0, loaders=0)


def live_or_die(name: str, death: str | None, after_s: float) -> str:
    time.sleep(after_s)
    if death:
        DEATHS[death]()
    return name.upper()


def crowd(seed: int) -> list[tuple[str, tuple[str, str | None, float]]]:
    """Tasks of which some die, at once or in the middle of others."""
    rng = random.Random(seed)
    deaths = [None] * 16 + list(DEATHS)
    rng.shuffle(deaths)
    return [(f"t{i}", (f"t{i}", death, rng.choice([0.0, rng.random() * 0.05]))) for i, death in enumerate(deaths)]


@pytest.mark.parametrize("workers", [1, 3])
def test_tasks_that_die_at_any_moment_cost_themselves_alone(workers: int) -> None:
    """Whoever is blamed for a death, dies: the same results and errors for any number of workers."""
    tasks = crowd(workers)
    found = list(map_in_order(live_or_die, tasks, len(tasks), compute(workers), "die"))
    assert [name for name, _ in found] == [name for name, _ in tasks]
    for (name, result), (_, (_, death, _)) in zip(found, tasks, strict=True):
        assert str(result) == (f"{name}: killed its worker process 3 times" if death else name.upper())
        assert isinstance(result, RuntimeError) == bool(death)


def die_the_first_time(folder: Path) -> str:
    if not (folder / "died").exists():
        (folder / "died").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "alive"


def test_a_death_that_was_not_the_tasks_doing_costs_nothing(tmp_path: Path) -> None:
    assert list(map_objects(die_the_first_time, [("t", (tmp_path,))], 1, compute(1), "die")) == [("t", "alive")]


def spoil_or_die(spoils: bool) -> bool:
    """A task that leaves its process in a state of which the next one dies."""
    if hasattr(os, "spoilt"):
        os.abort()
    if spoils:
        os.spoilt = True  # type: ignore[attr-defined]
    return spoils


def test_a_task_is_not_blamed_for_what_an_earlier_one_did_to_its_process() -> None:
    tasks = [(str(i), (i % 3 == 0,)) for i in range(9)]
    found = dict(map_objects(spoil_or_die, tasks, len(tasks), compute(1), "spoil"))
    assert found == {str(i): i % 3 == 0 for i in range(9)}


class Untold(Exception):
    """Pickles, but does not come back."""

    def __init__(self, one: int, two: int) -> None:
        super().__init__("untold")


def fail(how: str) -> Any:
    if how == "raises":
        raise Untold(1, 2)
    return sys._getframe()


def test_what_cannot_be_sent_back_is_an_error_of_its_task() -> None:
    found = dict(map_objects(fail, [(how, (how,)) for how in ("raises", "frame")], 2, compute(1), "fail"))
    assert str(found["raises"]) == "Untold: untold"
    assert isinstance(found["frame"], Exception)


def surroundings() -> tuple[int, dict[str, str], int]:
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
    return os.getpid(), {name: os.environ[name] for name in names}, len(gc.callbacks)


def family() -> list[psutil.Process]:
    return [psutil.Process(), *psutil.Process().children(recursive=True)]


def listening() -> set[Any]:
    return {socket.laddr for one in family() for socket in one.net_connections() if socket.status == "LISTEN"}


def test_a_map_listens_nowhere_and_its_processes_end_with_it() -> None:
    before, there = listening(), set(family())
    tasks = ((str(i), ()) for i in itertools.count())
    results = map_objects(surroundings, tasks, 1, compute(2), "listen")
    for _, (pid, threads, callbacks) in itertools.islice(results, 8):
        assert psutil.pid_exists(pid) and pid != os.getpid()
        assert set(threads.values()) == {"1"}
        assert not callbacks  # Dask's look at garbage collections raised RecursionErrors in tasks
        assert listening() == before
    results.close()  # type: ignore[attr-defined]
    assert set(family()) == there


def test_where_no_process_starts_a_line_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    with pytest.raises(ClusterError, match=r"^compute.workers: .*false ends before it takes a task, 3 times$"):
        list(map_objects(surroundings, [("t", ())], 1, compute(1), "start"))


def test_code_that_changes_meanwhile_mixes_with_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pools, "package_digest", lambda: "of an hour ago")
    with pytest.raises(ClusterError, match="the code of graspfn was changed since this began"):
        list(map_objects(surroundings, [("t", ())], 1, compute(1), "change"))


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    with dask_scheduler() as address:
        yield address


def slow(name: str) -> str:
    time.sleep(0.2)
    return name


NAMES = [(name, (name,)) for name in "abcdef"]
SAME = {name: name for name in "abcdef"}


def test_tasks_wait_for_a_worker_and_outlive_it(
    scheduler: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("graspfn.workflow.parallel.LOOK_S", 0.1)
    looks: list[int] = []  # how many workers there were at each

    def look(pool: pools.DaskPool, waited: Callable[[pools.DaskPool], None] = pools.DaskPool.wait_for_workers) -> None:
        waited(pool)
        looks.append(pool.size())

    monkeypatch.setattr(pools.DaskPool, "wait_for_workers", look)
    results = map_objects(slow, NAMES, len(NAMES), compute(address=scheduler), "wait")

    found: dict[str, Any] = {}

    def collect() -> None:
        for name, result in results:
            found[name] = result

    thread = threading.Thread(target=collect)
    thread.start()
    while len(looks) < 2:
        time.sleep(0.05)
    with dask_worker(scheduler):
        while not found:
            time.sleep(0.05)
    with dask_worker(scheduler):
        thread.join()
    assert found == SAME
    assert f"compute.address: no worker at {scheduler}; waiting for one" in capsys.readouterr().err


def test_a_worker_with_other_code_is_named(scheduler: str, tmp_path: Path) -> None:
    """Also if it joins late: no task of it counts."""
    shutil.copytree(Path(graspfn.__file__).parent, tmp_path / "graspfn")
    with (tmp_path / "graspfn" / "params.py").open("a") as file:
        file.write("# as it was before\n")
    with dask_worker(scheduler):
        assert dict(map_objects(slow, NAMES, len(NAMES), compute(address=scheduler), "same")) == SAME
        endless = ((str(i), (str(i),)) for i in itertools.count())
        results = map_objects(slow, endless, 1, compute(address=scheduler), "other")
        assert next(iter(results))[1] in "0123"
        with (
            dask_worker(scheduler, path=tmp_path),
            pytest.raises(ClusterError, match=r"^compute.address: worker tcp://127.*: its code of graspfn is not"),
        ):
            list(itertools.islice(results, 100))


def test_a_worker_without_graspfn_is_named(scheduler: str) -> None:
    with (
        dask_worker(scheduler, lacks=True),
        pytest.raises(
            ClusterError, match=r"^compute.address: worker tcp://127.*graspfn.*; install the graspfn of this"
        ),
    ):
        list(map_objects(slow, NAMES, len(NAMES), compute(address=scheduler), "lack"))


def test_a_scheduler_that_goes_away_ends_the_map_with_a_line() -> None:
    endless = ((str(i), (str(i),)) for i in itertools.count())
    with dask.config.set({"distributed.comm.timeouts.connect": "1s"}):
        with dask_scheduler() as address, dask_worker(address):
            results = map_objects(slow, endless, 1, compute(address=address), "gone")
            assert next(iter(results))
        with pytest.raises(ClusterError, match=f"^compute.address: the scheduler at {address} is gone$"):
            list(results)
