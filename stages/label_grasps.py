"""Attempt a grasp at every pose of Q of every training object (paper III-C)."""

from pathlib import Path

import numpy as np
import pandas as pd

from graspfn.geometry.grid import SHAPE
from graspfn.meshes.placed import Resting, load_resting, resting_rows
from graspfn.params import Declared
from graspfn.physics.labelling import Labels, joined, label_object
from graspfn.physics.world import Rig
from graspfn.workflow.files import read_npz, write_npz, write_parquet
from graspfn.workflow.parallel import map_objects
from graspfn.workflow.seeds import generator
from graspfn.workflow.shards import code_digest, shard_key, shard_path, sweep
from graspfn.workflow.stage import stage

MESHES, COLLISION, PLACED = Path("data/objects/train"), Path("data/collision/train"), Path("data/placed/train.parquet")
ANGLES = SHAPE[2]  # an object is labelled in as many parts, so that one large object does not keep one core busy alone
LABELS, ACCOUNT = Path("data/labels.npz"), Path("data/label_account.parquet")


class LabelError(ValueError):
    """Too many objects could not be labelled."""


def label_part(name: str, angle: int, resting: Resting, attempts: int, rig: Rig, seed: int) -> Labels:
    rng = generator(seed, "label_grasps", name)
    return label_object(resting, attempts, rig, rng, slice(angle, angle + 1))


@stage("label_grasps")
def main(params: Declared) -> None:
    attempts, rig = params.label.attempts, Rig(params.physics, params.gripper, params.attempt)
    code = code_digest("workflow", "geometry", "meshes", "physics")
    placed = resting_rows(PLACED)
    shards = {}
    for name, row in placed.items():
        files = [folder / f"{name}.ply" for folder in (MESHES, COLLISION)]
        key = shard_key(name, *files, row, attempts, rig, params.seed, code, Path(__file__))
        shards[name] = shard_path("label_grasps", key)
    todo = [name for name, path in shards.items() if not path.exists()]
    if len(todo) < len(shards):
        print(f"{len(shards) - len(todo)} of {len(shards)} objects were labelled before")
    tasks = (
        (f"{name}/{angle}", (name, angle, resting, attempts, rig, params.seed))
        for name in todo
        for resting in [load_resting(MESHES, COLLISION, placed[name])]
        for angle in range(ANGLES)
    )
    parts: dict[str, dict[int, Labels]] = {name: {} for name in todo}
    failed = {}
    count = len(todo) * ANGLES
    for task, result in map_objects(
        label_part, tasks, count, params.compute, "label", parts=ANGLES, attempts=lambda part: part.simulated
    ):
        name, _, angle = task.rpartition("/")
        if isinstance(result, Exception):
            failed[name] = str(result)
            continue
        parts[name][int(angle)] = result
        if len(parts[name]) == ANGLES:
            labels = joined([part for _, part in sorted(parts.pop(name).items())])
            account = {f"account_{key}": np.array(count) for key, count in labels.account.items()}
            write_npz(shards[name], {"successes": labels.successes, **account})
    if len(failed) > params.label.max_failed * len(shards):
        first = next(f"{name}: {reason}" for name, reason in failed.items())
        raise LabelError(f"{len(failed)} of {len(shards)} objects failed, above label.max_failed; the first, {first}")

    done = {name: read_npz(path) for name, path in shards.items() if name not in failed}
    names = sorted(done)
    arrays = {"ids": np.array(names), "successes": np.stack([done[name]["successes"] for name in names])}
    write_npz(LABELS, arrays | {"attempts": np.array(params.label.attempts)})
    rows = [
        {
            "id": name,
            "status": failed.get(name, "labelled"),
            "best": int(done[name]["successes"].max()) if name in done else 0,  # attempts that held at the best pose
        }
        | {key.removeprefix("account_"): int(v) for key, v in done.get(name, {}).items() if key.startswith("account_")}
        for name in sorted(shards)
    ]
    write_parquet(ACCOUNT, pd.DataFrame(rows))
    sweep("label_grasps", shards.values())


if __name__ == "__main__":
    main()
