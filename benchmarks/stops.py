"""How many lifts would be stopped wrongly as held, and how much of the time is saved (docs/physics.md, An attempt).

    python benchmarks/stops.py --objects 30 --attempts 40

Every attempt runs to its end once, with the motion of the object in the hand kept. Each rule then says of that motion
where it would have stopped.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import dartpy as dart
import numpy as np
import pandas as pd
from objects import committed, finished, resting_objects, results_of, rig_of, touching

from graspfn.meshes.placed import Resting
from graspfn.params import LOOK_MS
from graspfn.physics.attempt import CLEAR_M, GRIP_M, HALF, LEVER_M, Frame, Grasper, yet_to_move
from graspfn.physics.world import Rig
from graspfn.seeds import generator
from graspfn.workflow.cores import cores

RULES = tuple((grip_m, half) for grip_m in (0.1e-3, 0.2e-3, 0.4e-3, 1.6e-3) for half in (HALF, 2 * HALF))


def motion(frames: Sequence[Frame], points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 6) place of the object in the hand at every look of a lift, as Grasper has it, and (n,) whether it is clear.

    points: the object's, of which the lowest is one.
    """
    T = np.array([frame.T_world_object for frame in frames])
    grips = np.array([dart.dynamics.FreeJoint.convertToPositions(one) for one in T]) * LEVER_M
    grips[:, 5] -= [frame.hand_z for frame in frames]
    return grips, (T[:, 2, :3] @ points.T).min(axis=1) + T[:, 2, 3] > CLEAR_M


def stop(grips: np.ndarray, clear: np.ndarray, grip_m: float, half: int) -> int | None:
    """The look of a lift after which it would be stopped as held; None if it never would."""
    for look in range(2 * half, len(grips) - 1):
        before, now = (np.abs(grips[end] - grips[end - half]).max() for end in (look - half, look))
        if clear[look] and yet_to_move(before, now, (len(grips) - 1 - look) / half) < grip_m:
            return look
    return None


def study(name: str, resting: Resting, rig: Rig, attempts: int, seed: int) -> pd.DataFrame:
    """A line for every rule and every attempt that sets off."""
    grasper = Grasper(resting, rig)
    rows = []
    for i, q in enumerate(touching(resting, rig, attempts, generator(seed, "stops", name))):
        result = grasper.run(q, whole=True, film=True)
        grips, clear = motion([frame for frame in result.frames if frame.hand_z > 0], grasper.world.points)
        for rule, (grip_m, half) in enumerate(RULES):
            look = stop(grips, clear, grip_m, half)
            share = 1.0 if look is None else (look + 1) / len(grips)
            row = {"attempt": f"{name} {i}", "rule": rule, "held": result.held, "share": share}
            rows.append(row | {"wrong": look is not None and not result.held})
    return pd.DataFrame(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, default=6)
    parser.add_argument("--attempts", type=int, default=20, help="of each object")
    parser.add_argument("--workers", type=int, default=cores())
    arguments = parser.parse_args()
    params = committed()
    rig = rig_of(params)
    objects = resting_objects(params, arguments.objects, arguments.workers)
    tasks = [(name, resting, rig, arguments.attempts, params.seed) for name, resting in objects]
    names = (name for name, _ in objects)
    table = pd.concat([one for _, one in finished(names, results_of(study, tasks, arguments.workers, "stops"))])
    print(f"{table['attempt'].nunique()} attempts, {table.groupby('attempt')['held'].first().mean():.1%} held")
    for rule, (grip_m, half) in enumerate(RULES):
        of_rule = table[table["rule"] == rule]
        chosen = " <- as committed" if (grip_m, half) == (GRIP_M, HALF) else ""
        share = of_rule.loc[of_rule["held"], "share"].mean()
        print(
            f"may move by {1e3 * grip_m:g} mm, watched for {2 * half * LOOK_MS:g} ms: {of_rule['wrong'].sum()} wrongly "
            f"held, {share:.2f} of the time of those that hold{chosen}"
        )


if __name__ == "__main__":
    main()
