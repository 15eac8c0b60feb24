"""Labels are the same bits whoever makes them, in whatever order, and whichever worker dies of it."""

from __future__ import annotations

import itertools
import os
import signal
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import trimesh
from by_hand import dask_scheduler, dask_worker
from physics_params import ATTEMPT, GRIPPER, PHYSICS

from graspfn.geometry.transforms import translation
from graspfn.meshes.placed import Resting
from graspfn.params import Compute
from graspfn.physics.labelling import Labels, label_object
from graspfn.physics.world import Rig
from graspfn.seeds import generator
from graspfn.workflow.parallel import map_objects

# Dask leaves sockets to the garbage collector.
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

RIG = Rig(PHYSICS, GRIPPER, replace(ATTEMPT, lift_mm=20.0))
BOX, RING = trimesh.creation.box([0.03, 0.02, 0.02]), trimesh.creation.annulus(0.012, 0.02, 0.02, sections=12)
OBJECTS = {name: Resting(mesh, mesh, translation(0, 0, 0.01)) for name, mesh in (("box", BOX), ("ring", RING))}
PARTS = [(name, angle) for name in OBJECTS for angle in (0, 4)]

Made = tuple[bytes, dict[str, int]]  # outcomes and account: every bit of a part's labels
Task = tuple[str, tuple[Any, ...]]


def made(labels: Labels) -> Made:
    return labels.outcomes.tobytes(), labels.account


def label_part(
    name: str, angle: int, resting: Resting, starts: Path | None = None, victim: str | None = None
) -> Labels:
    """As stage label_grasps does; notes its process in a file of folder `starts`, and the victim's first never ends."""
    task, endless = f"{name}-{angle}", False
    if starts:
        endless = task == victim and not (starts / task).exists()
        note_start(starts / task)
    while True:
        labels = label_object(resting, 1, RIG, generator(0, "label_grasps", name), slice(angle, angle + 1))
        if not endless:
            return labels


def note_start(path: Path) -> None:
    with path.open("a") as file:
        file.write(f"{os.getpid()}\n")


def processes(starts: Path) -> dict[str, list[int]]:
    """Of every task, the processes that started it."""
    return {path.name: [int(line) for line in path.read_text().split()] for path in starts.iterdir()}


def tasks(*more: Any) -> list[Task]:
    return [(f"{name}-{angle}", (name, angle, OBJECTS[name], *more)) for name, angle in PARTS]


def compute(workers: int = 0, address: str | None = None) -> Compute:
    return Compute(address=address, workers=workers, device="cpu", checkpoint_s=60.0, loaders=0)


def mapped(todo: list[Task], how: Compute) -> dict[str, Made]:
    found = dict(map_objects(label_part, todo, len(todo), how, "label"))
    failed = {name: result for name, result in found.items() if isinstance(result, Exception)}
    assert not failed
    return {name: made(labels) for name, labels in found.items()}


@pytest.fixture(scope="module")
def expected() -> dict[str, Made]:
    """Made in this process, without any worker."""
    return {f"{name}-{angle}": made(label_part(name, angle, OBJECTS[name])) for name, angle in PARTS}


def test_there_is_something_to_get_wrong(expected: dict[str, Made]) -> None:
    assert len({successes for successes, _ in expected.values()}) == len(PARTS)
    for _, account in expected.values():
        assert account["held"] >= 5
        assert account["missed"] + account["left"] >= 5


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_workers_order_and_repetition_change_no_bit(expected: dict[str, Made], workers: int) -> None:
    there = tasks()
    back = [(f"{name} again", arguments) for name, arguments in reversed(there)]
    found = mapped(there + back, compute(workers))
    assert found == expected | {f"{name} again": labels for name, labels in expected.items()}


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """Address of a scheduler with two workers, started by hand as docs/cluster.md says."""
    with dask_scheduler() as address, dask_worker(address), dask_worker(address):
        yield address


def test_a_scheduler_started_by_hand_gives_the_same_labels(
    scheduler: str, expected: dict[str, Made], tmp_path: Path
) -> None:
    assert mapped(tasks(tmp_path), compute(address=scheduler)) == expected
    assert len(set(itertools.chain(*processes(tmp_path).values()))) == 2


def test_a_worker_killed_in_mid_task_costs_that_task_alone(
    scheduler: str, expected: dict[str, Made], tmp_path: Path
) -> None:
    victim = "box-0"

    def kill() -> None:
        deadline = time.monotonic() + 60
        while not (tmp_path / victim).exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(0.5)
        os.kill(processes(tmp_path)[victim][0], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    assert mapped(tasks(tmp_path, victim), compute(address=scheduler)) == expected
    killer.join()
    assert {name: len(pids) for name, pids in processes(tmp_path).items()} == {
        name: 2 if name == victim else 1 for name in expected
    }


def label_or_linger(lingers: Path, *arguments: Any) -> Labels:
    """label_part; on a worker that is to be killed it says that it began, and goes on until then."""
    if "DOOMED" in os.environ:
        note_start(lingers)
        while True:
            label_part(*arguments)
    return label_part(*arguments)


def give_up_after(deaths: int, scheduler: str) -> None:
    """Have the scheduler give up tasks of which more workers died."""
    from distributed import Client

    with Client(scheduler) as client:
        client.run_on_scheduler(lambda dask_scheduler: setattr(dask_scheduler, "allowed_failures", deaths))


def test_one_of_four_workers_killed_twice_changes_no_bit(
    scheduler: str, expected: dict[str, Made], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each time in mid-task and with more of them to do; tasks do not run out before that.

    After the first death the scheduler itself has its tasks done elsewhere, after the second it gives them up.
    """
    lingers, killed, over = tmp_path / "lingers", threading.Event(), threading.Event()
    lingers.touch()
    asked: dict[str, Made] = {}

    def supply() -> Iterator[Task]:
        for again in itertools.takewhile(lambda _: not killed.is_set(), itertools.count()):
            for name, angle in PARTS:
                asked[f"{name}-{angle} {again}"] = expected[f"{name}-{angle}"]
                yield f"{name}-{angle} {again}", (lingers, name, angle, OBJECTS[name])

    def kill_twice() -> None:
        for death, forgiven in ((1, 3), (2, 0)):
            give_up_after(forgiven, scheduler)
            with dask_worker(scheduler):
                while len(lingers.read_text().split()) < death and not over.is_set():
                    time.sleep(0.05)
        killed.set()

    killer = threading.Thread(target=kill_twice)
    with dask_worker(scheduler):
        monkeypatch.setenv("DOOMED", "1")
        killer.start()
        try:
            found = dict(map_objects(label_or_linger, supply(), 1, compute(address=scheduler), "label"))
        finally:
            over.set()
            killer.join()
            give_up_after(3, scheduler)
    assert len(lingers.read_text().split()) == 2
    failed = [str(result) for result in found.values() if isinstance(result, Exception)]
    assert not failed
    assert {name: made(labels) for name, labels in found.items()} == asked


def die(starts: Path) -> None:
    note_start(starts / "dies")
    os.kill(os.getpid(), signal.SIGKILL)


def label_or_die(starts: Path, *arguments: Any) -> Labels | None:
    return label_part(*arguments) if arguments else die(starts)


def test_a_task_that_kills_three_workers_takes_no_other_with_it(
    scheduler: str, expected: dict[str, Made], tmp_path: Path
) -> None:
    todo = [(name, (tmp_path, *arguments)) for name, arguments in tasks()]
    todo.insert(1, ("dies", (tmp_path,)))
    found = dict(map_objects(label_or_die, todo, len(todo), compute(address=scheduler), "label"))
    assert str(found.pop("dies")) == "dies: killed its worker process 3 times"
    assert {name: made(labels) for name, labels in found.items()} == expected
    assert len(processes(tmp_path)["dies"]) == 3
