"""Whether outcomes depend on time step, contact detector or contact cap, and where they do (docs/physics.md).

    python benchmarks/convergence.py --objects 30 --attempts 100

Every attempt runs every step: as committed, with half the step, with FCL's contacts for ODE's, and from a pose 0.1 mm
and 0.1 degrees off, which shows how much of the difference is chaos that no step would remove. Five more draws from the
pose's cell of Q say how good a grasp it is.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
from objects import NUDGE, committed, finished, resting_objects, results_of, rig_of, touching
from worlds import WatchedGrasper

from graspfn.evaluation.statistics import paired_difference, proportion
from graspfn.geometry import grid
from graspfn.meshes.placed import Resting
from graspfn.physics.attempt import Grasper
from graspfn.physics.world import DETECTORS, Rig
from graspfn.seeds import generator
from graspfn.workflow.cores import cores

NEARBY = 5  # draws from the cell of a pose
DEEP_M = 2e-3  # no accepted attempt may have hand and object so deep in each other
CAPS = "1000 in all and 250 of a pair"  # DART's default, and what its ODE wrapper makes room for
CHANGES = {"half": "half the step", "other": "ODE for FCL, or FCL for ODE", "nudged": "0.1 mm, 0.1 degrees off"}
GRASPS = {"poor": "none holds", "unsure": "some hold", "good": "all hold"}


def varied(rig: Rig, **changes: object) -> Rig:
    return replace(rig, physics=replace(rig.physics, **changes))  # type: ignore[arg-type]


def study(name: str, resting: Resting, rig: Rig, attempts: int, seed: int) -> pd.DataFrame:
    """A line for every attempt on one object."""
    rng = generator(seed, "convergence", name)
    watched, plain = WatchedGrasper(resting, rig), Grasper(resting, rig)
    half = Grasper(resting, varied(rig, time_step_ms=rig.physics.time_step_ms / 2))
    other = Grasper(resting, varied(rig, detector="ode" if rig.physics.detector == "fcl" else "fcl"))
    rows = []
    for q in touching(resting, rig, attempts, rng):
        result, world = watched.run(q, whole=True), watched.world
        row = {"object": name, "held": result.held, "contacts": world.contacts, "said": world.said}
        row |= {"depth": world.depth, "retried": result.retried}
        row |= {"half": half.run(q, whole=True).held, "other": other.run(q, whole=True).held}
        direction = rng.normal(size=2)
        nudge = NUDGE * [*direction / np.linalg.norm(direction), rng.choice([-1, 1])]
        row["nudged"] = plain.run(q + nudge, whole=True).held
        cell = grid.from_index(np.round(grid.to_index(q)))
        near = cell + rng.uniform(-0.5, 0.5, (NEARBY, 3)) * [grid.CELL_M, grid.CELL_M, grid.CELL_RAD]
        row["near"] = np.mean([plain.run(pose, whole=True).held for pose in near])
        rows.append(row)
    return pd.DataFrame(rows)


def print_changes(table: pd.DataFrame) -> None:
    """How many outcomes each change turns round, in grasps of every kind, and by how much the success rate moves."""
    kind = np.select([table["near"] == 0, table["near"] == 1], ["poor", "good"], "unsure")
    rows = []
    for column, change in CHANGES.items():
        turned, objects = table[column] != table["held"], table["object"].to_numpy()
        moved = paired_difference(table[column].to_numpy(), table["held"].to_numpy(), objects)
        row = {"change": change, "turned, %": _percent(turned.to_numpy(), objects)}
        for name in GRASPS:
            chosen = kind == name
            row[f"of {name}"] = _percent(turned.to_numpy()[chosen], objects[chosen]) if chosen.any() else "-"
        row["success rate, points"] = f"{100 * moved.value:+.1f} ({100 * moved.low:+.1f} to {100 * moved.high:+.1f})"
        rows.append(row)
    counts = ", ".join(f"{name} ({means} of {NEARBY} nearby): {np.sum(kind == name)}" for name, means in GRASPS.items())
    print(f"{len(table)} attempts on {table['object'].nunique()} objects, {table['held'].mean():.1%} held; {counts}")
    print(pd.DataFrame(rows).to_string(index=False))


def _percent(values: np.ndarray, objects: np.ndarray) -> str:
    share = proportion(values, objects)
    return f"{100 * share.value:.1f} ({100 * share.low:.1f}-{100 * share.high:.1f})"


def print_contacts(table: pd.DataFrame) -> None:
    """The most contacts of any step, and how deep accepted attempts have hand and object in each other."""
    print(f"most contacts of any step, all pairs together: {table['contacts'].max()}; the caps are {CAPS}")
    held = table[table["held"]]
    for column, means in (("said", "the detector's own depth, at every step"), ("depth", "measured")):
        mm = 1e3 * held[column]
        print(
            f"deepest in {len(held)} accepted attempts, {means}: median {mm.median():.2f} mm, 99.9th percentile "
            f"{mm.quantile(0.999):.2f}, most {mm.max():.2f}; above 2 mm in {(held[column] > DEEP_M).mean():.2%}"
        )
    worst = held.nlargest(5, "said")
    for name, said, depth in zip(worst["object"], worst["said"], worst["depth"], strict=True):
        print(f"  {name}: {1e3 * said:.2f} mm said, {1e3 * depth:.2f} mm measured")
    print(f"ran away and were run again with half the step: {table['retried'].sum()} of {len(table)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, default=6)
    parser.add_argument("--attempts", type=int, default=20, help="of each object")
    parser.add_argument("--step-ms", type=float, help="instead of the committed time step")
    parser.add_argument("--detector", choices=tuple(DETECTORS), help="instead of the committed one")
    parser.add_argument("--workers", type=int, default=cores())
    arguments = parser.parse_args()
    params = committed()
    objects = resting_objects(params, arguments.objects, arguments.workers)
    step, detector = arguments.step_ms or params.physics.time_step_ms, arguments.detector or params.physics.detector
    rig = varied(rig_of(params), time_step_ms=step, detector=detector)
    tasks = [(name, resting, rig, arguments.attempts, params.seed) for name, resting in objects]
    names = (name for name, _ in objects)
    tables = [table for _, table in finished(names, results_of(study, tasks, arguments.workers, "study"))]
    print(f"{detector}, time step {step:g} ms")
    print_changes(pd.concat(tables))
    print_contacts(pd.concat(tables))
    print("reproduce: python benchmarks/" + " ".join(["convergence.py", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
