"""DART against MuJoCo on the same grasp attempts: do they agree on what is held, and where not, why (docs/physics.md)?

    python benchmarks/cross_engine.py --objects 30 --attempts 100

Hulls of Bullet's random objects and a few solids, so that both engines touch the same convex shape. Every attempt runs
to its end in both, once as drawn and once moved by 0.1 mm and 0.1 degree: what that changes is undecided, and no second
engine could confirm it. All run with MuJoCo's contacts as soft as they come, too.
"""

from __future__ import annotations

import argparse
import functools
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from convex import SOLIDS, convex_objects
from mujoco_grasp import ADVISED, MujocoGrasper
from objects import NUDGE, committed, finished, results_of, rig_of, touching

from graspfn.evaluation.statistics import proportion
from graspfn.geometry.transforms import apply
from graspfn.meshes.placed import Resting
from graspfn.params import Params
from graspfn.physics.attempt import CLEAR_M, Frame, Grasper, Result
from graspfn.physics.gripper import Kinematics
from graspfn.physics.world import Rig
from graspfn.seeds import generator
from graspfn.workflow.cores import cores

SHUT = 0.01  # of a joint's range short of its stop: nothing is between the fingers
BOOTSTRAPS = 10_000
DART, MUJOCO = "DART", "MuJoCo"
MOVED = {DART: "DART, moved", MUJOCO: "MuJoCo, moved"}
SOFT = "MuJoCo, its own contacts"
WAYS = (DART, MOVED[DART], MUJOCO, MOVED[MUJOCO], SOFT)
Run = Callable[[np.ndarray], Result]


@dataclass(frozen=True)
class Compared:
    """Attempts on one object: held or not in every way, seconds of each, and how those that disagree were lost."""

    held: pd.DataFrame  # columns WAYS
    seconds: dict[str, float]
    lost: list[tuple[str, str]]  # the engine that held, and how the other one lost it


def compare(name: str, resting: Resting, params: Params, attempts: int) -> Compared:
    rig, rng = rig_of(params), generator(params.seed, "cross_engine", name, "attempts")
    poses = touching(resting, rig, attempts, rng)
    moved = poses + rng.choice([-1.0, 1.0], poses.shape) * NUDGE
    dart_run = functools.partial(Grasper(resting, rig).run, whole=True)
    mujoco_run = MujocoGrasper(resting, rig).run
    ways: dict[str, tuple[Run, np.ndarray]] = {
        DART: (dart_run, poses),
        MOVED[DART]: (dart_run, moved),
        MUJOCO: (mujoco_run, poses),
        MOVED[MUJOCO]: (mujoco_run, moved),
        SOFT: (MujocoGrasper(resting, rig, ADVISED).run, poses),
    }
    held, seconds = {}, {}
    for way, (run, some) in ways.items():
        started = time.process_time()
        held[way] = [run(q).held for q in some]
        seconds[way] = time.process_time() - started
    table = pd.DataFrame(held)
    lost = []
    for i in np.flatnonzero(table[DART] != table[MUJOCO]):
        winner, run = (DART, mujoco_run) if table[DART][i] else (MUJOCO, dart_run)
        lost.append((winner, how_lost(run(poses[i], film=True).frames, resting, rig)))
    return Compared(table, seconds, lost)


def how_lost(frames: Sequence[Frame], resting: Resting, rig: Rig) -> str:
    """What became of an object that was not held, from the frames of the attempt."""
    lift = [frame for frame in frames if frame.hand_z > 0]
    k = Kinematics.from_params(rig.gripper)
    if min(lift[0].fingers) > k.closed - SHUT * (k.closed - k.open):
        return "squeezed out before the lift"
    lowest = [apply(frame.T_world_object, resting.mesh.vertices)[:, 2].min() for frame in lift]
    return "lost in mid-air" if max(lowest) > CLEAR_M else "lost while it touched the table"


def f1_interval(a: np.ndarray, b: np.ndarray, objects: np.ndarray, seed: int) -> tuple[float, float, float]:
    """F1 of b (n,) bool with a (n,) bool as the reference, and its 95% interval: whole objects are drawn anew."""
    _, index = np.unique(objects, return_inverse=True)
    both, either = np.bincount(index, a & b), np.bincount(index, a.astype(int) + b)
    drawn = np.random.default_rng(seed).integers(len(both), size=(BOOTSTRAPS, len(both)))
    with np.errstate(invalid="ignore"):  # no success in all that was drawn
        spread = 2 * both[drawn].sum(axis=1) / either[drawn].sum(axis=1)
        low, high = np.nanquantile(spread, [0.025, 0.975])
        return float(2 * both.sum() / either.sum()), float(low), float(high)


def compared(rows: pd.DataFrame, first: str, second: str, seed: int) -> dict[str, str]:
    """How two ways agree."""
    a, b, objects = rows[first].to_numpy(), rows[second].to_numpy(), rows["object"].to_numpy()
    shares = {"first held": a, "second held": b, "agree": a == b}
    cells = {"attempts": str(len(rows)), "objects": str(len(np.unique(objects)))}
    for title, values in shares.items():
        share = proportion(values, objects)
        cells[title] = f"{share.value:.3f} ({share.low:.3f} to {share.high:.3f})"
    return cells | {"F1": "{:.3f} ({:.3f} to {:.3f})".format(*f1_interval(a, b, objects, seed))}


def tables(rows: pd.DataFrame, lost: pd.DataFrame, seconds: pd.DataFrame, seed: int) -> dict[str, pd.DataFrame]:
    decided = rows[(rows[DART] == rows[MOVED[DART]]) & (rows[MUJOCO] == rows[MOVED[MUJOCO]])]
    solid = rows["object"].isin(list(SOLIDS))
    groups = {"all": rows, "hulls": rows[~solid], "solids": rows[solid], "undecided left out": decided}
    pairs = [(DART, MOVED[DART]), (MUJOCO, MOVED[MUJOCO]), (DART, SOFT), (MUJOCO, SOFT)]
    ms = {way: 1e3 * seconds[way].sum() / len(rows) for way in WAYS}
    return {
        f"{DART}; {MUJOCO}": pd.DataFrame(
            {name: compared(part, DART, MUJOCO, seed) for name, part in groups.items()}
        ).T,
        "other pairs": pd.DataFrame(
            [{"first": a, "second": b} | compared(rows, a, b, seed) for a, b in pairs]
        ).set_index(["first", "second"]),
        "how an engine lost what the other held": pd.crosstab(lost["how"], lost["held by"]),
        "processor time": pd.DataFrame({"ms per attempt": ms}).round(1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, default=30, help="hulls, besides the solids")
    parser.add_argument("--attempts", type=int, default=100, help="of each object")
    parser.add_argument("--workers", type=int, default=cores())
    parser.add_argument("--json", type=Path, help="file for the tables")
    arguments = parser.parse_args()
    params = committed()
    objects = list(convex_objects(params, arguments.objects, arguments.workers))
    tasks = [(name, resting, params, arguments.attempts) for name, resting in objects]
    rows, lost, seconds = [], [], []
    names = (name for name, _ in objects)
    for name, done in finished(names, results_of(compare, tasks, arguments.workers, "grasp")):
        rows.append(done.held.assign(object=name))
        lost += done.lost
        seconds.append(done.seconds)
    found = tables(
        pd.concat(rows, ignore_index=True),
        pd.DataFrame(lost, columns=["held by", "how"]),
        pd.DataFrame(seconds),
        params.seed,
    )
    for title, table in found.items():
        print(f"\n{title}\n{table.to_string()}")
    print("\nreproduce: python benchmarks/" + " ".join(["cross_engine.py", *sys.argv[1:]]))
    if arguments.json:
        text = {title: table.reset_index().to_dict("records") for title, table in found.items()}
        arguments.json.write_text(json.dumps(text, indent=1) + "\n")


if __name__ == "__main__":
    main()
