"""Labels by Dask workers on this machine, some killed: the same bits, and at what speed (docs/cluster.md).

    python benchmarks/cluster.py --objects 8 --workers 1 2 4

In a folder where place_objects ran. Labels the first training objects as the stage does: by one process here, then
through a scheduler with ever more workers, undisturbed and with one of them killed twice. Then the same tasks with
nothing to do, on the processor's clock: how many cores one head node and one scheduler keep busy.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from objects import committed, rig_of

from graspfn.geometry.grid import SHAPE
from graspfn.meshes.placed import Resting, load_resting, resting_rows
from graspfn.meshes.store import read_manifest
from graspfn.params import Compute, Params
from graspfn.physics.labelling import Labels, label_object
from graspfn.physics.world import Rig
from graspfn.seeds import seed_of
from graspfn.workflow.child import packed
from graspfn.workflow.parallel import Task, map_objects

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from by_hand import dask_scheduler, dask_worker  # type: ignore[import-not-found]

OBJECTS, COLLISION, PLACED = Path("data/objects/train"), Path("data/collision/train"), Path("data/placed/train.parquet")
ANGLES = SHAPE[2]
KILLS = (1 / 3, 2 / 3)  # shares of the tasks that are done when a worker is killed
IDLE_TASKS = 1200

Bits = dict[str, tuple[bytes, dict[str, int]]]


def label_part(angle: int, resting: Resting, attempts: int, rig: Rig, seed: int) -> Labels:
    """As stage label_grasps."""
    return label_object(resting, attempts, rig, np.random.default_rng(seed), slice(angle, angle + 1))


def tasks_of(names: Sequence[str], params: Params) -> Iterator[Task]:
    """A task for each angle of each object; objects are read as they are asked for, as the stage does."""
    placed, rig = resting_rows(PLACED), rig_of(params)
    for name in names:
        resting, seed = load_resting(OBJECTS, COLLISION, placed[name]), seed_of(params.seed, "label_grasps", name)
        for angle in range(ANGLES):
            yield f"{name}/{angle}", (angle, resting, params.label.attempts, rig, seed)


def bits(name: str, labels: Labels | Exception) -> tuple[bytes, dict[str, int]]:
    if isinstance(labels, Exception):
        raise SystemExit(f"{name}: {labels}")
    return labels.outcomes.tobytes(), labels.account


def here(names: Sequence[str], params: Params, compute: Compute) -> tuple[float, Bits]:
    """Seconds, and all labels, of one process of this machine."""
    started = time.perf_counter()
    made = map_objects(label_part, tasks_of(names, params), ANGLES * len(names), compute, "here", parts=ANGLES)
    found = {name: bits(name, labels) for name, labels in made}
    return time.perf_counter() - started, found


def through_scheduler(
    names: Sequence[str], params: Params, compute: Compute, workers: int, kills: Sequence[float]
) -> tuple[float, Bits]:
    """As `here`, by so many workers; one is killed and started anew at these shares of the work."""
    total, found, left = ANGLES * len(names), dict[str, Any](), list(kills)
    with dask_scheduler() as address, ExitStack() as lasting, ExitStack() as killed:
        for i in range(workers):
            (killed if i == workers - 1 else lasting).enter_context(dask_worker(address))
        there, label = replace(compute, address=address), f"{workers} workers, {len(kills)} kills"
        started = time.perf_counter()
        for name, labels in map_objects(label_part, tasks_of(names, params), total, there, label, parts=ANGLES):
            found[name] = bits(name, labels)
            if left and len(found) >= left[0] * total:
                left.pop(0)
                killed.close()
                killed.enter_context(dask_worker(address))
        return time.perf_counter() - started, found


def nothing(*arguments: Any) -> None:
    """The task of `print_head`."""


def print_head(names: Sequence[str], params: Params, compute: Compute, task_s: float) -> None:
    """What a task costs the head node and the scheduler."""
    from distributed import Client

    sizes = [len(packed(label_part, arguments)) for _, arguments in tasks_of(names, params)]
    objects = [names[i % len(names)] for i in range(-(-IDLE_TASKS // ANGLES))]
    tasks = ((f"{i}", arguments) for i, (_, arguments) in enumerate(tasks_of(objects, params)))
    with dask_scheduler() as address, dask_worker(address), Client(address) as client:
        there, before = replace(compute, address=address), client.run_on_scheduler(time.process_time)
        started = time.process_time()
        done = sum(1 for _ in map_objects(nothing, tasks, 1, there, None))
        head_s = (time.process_time() - started) / done
        scheduler_s = (client.run_on_scheduler(time.process_time) - before) / done
    print(f"a task is {np.mean(sizes) / 1e3:.0f} kB (most {max(sizes) / 1e3:.0f}) and {task_s:.1f} s of a core")
    for what, each_s in (("head node", head_s), ("scheduler", scheduler_s)):
        print(f"{what}: {1e3 * each_s:.1f} ms of its processor a task, enough for {task_s / each_s:.0f} cores")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, default=8)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2, 4])
    arguments = parser.parse_args()
    params, placed = committed(), resting_rows(PLACED)
    compute = replace(params.compute, address=None, workers=1)
    order = read_manifest(OBJECTS).sort_values("seed_index")["id"]
    names = [name for name in order if name in placed][: arguments.objects]
    alone_s, expected = here(names, params, compute)
    print(f"{len(names)} objects, one process here: {alone_s:.1f} s")
    undisturbed: dict[int, float] = {}
    for kills in ((), KILLS):
        for workers in arguments.workers:
            seconds, found = through_scheduler(names, params, compute, workers, kills)
            same = "same bits" if found == expected else "OTHER BITS"
            print(f"{workers} workers, {len(kills)} kills: {seconds:.1f} s, {same}")
            if not kills:
                undisturbed[workers] = seconds
    if {1, 2} <= set(undisturbed):
        print(f"efficiency from 1 to 2 workers: {undisturbed[1] / (2 * undisturbed[2]):.1%}")
    print_head(names, params, compute, alone_s / len(expected))
    print("reproduce: python benchmarks/" + " ".join(["cluster.py", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
