"""Attempt a grasp at every pose of Q of every training object (paper III-C)."""

from pathlib import Path

import numpy as np
import pandas as pd
import trimesh

from graspfn.meshes.placed import T_world_object, read_resting
from graspfn.meshes.store import load_object
from graspfn.params import Attempt, Declared, Gripper, Label, Physics
from graspfn.physics.labelling import Labels, label_object
from graspfn.workflow.files import read_npz, write_npz, write_parquet
from graspfn.workflow.parallel import map_objects
from graspfn.workflow.seeds import generator
from graspfn.workflow.shards import code_digest, shard_key, shard_path, sweep
from graspfn.workflow.stage import stage

MESHES, PLACED = Path("data/objects/train"), Path("data/placed/train.parquet")
LABELS, ACCOUNT = Path("data/labels.npz"), Path("data/label_account.parquet")


def label(
    name: str, mesh: trimesh.Trimesh, T: np.ndarray, what: tuple[Label, Physics, Gripper, Attempt], seed: int
) -> Labels:
    labels, physics, gripper, attempt = what
    return label_object(mesh, T, labels.attempts, physics, gripper, attempt, generator(seed, "label_grasps", name))


@stage("label_grasps")
def main(params: Declared) -> None:
    what = (params.label, params.physics, params.gripper, params.attempt)
    code = code_digest("workflow", "geometry", "meshes", "physics")
    placed = read_resting(PLACED).set_index("id", drop=False)
    poses = {row["id"]: T_world_object(row) for row in placed.to_dict("records")}
    shards = {}
    for name, T in poses.items():
        key = shard_key(name, MESHES / f"{name}.ply", T.tolist(), what, params.seed, code)
        shards[name] = shard_path("label_grasps", key)
    todo = [name for name, path in shards.items() if not path.exists()]
    if len(todo) < len(shards):
        print(f"{len(shards) - len(todo)} of {len(shards)} objects were labelled before")
    tasks = ((name, (name, load_object(MESHES, name), poses[name], what, params.seed)) for name in todo)
    failed = {}
    for name, result in map_objects(label, tasks, len(todo), params.compute, "label"):
        if isinstance(result, Exception):
            failed[name] = str(result)
            continue
        account = {f"account_{key}": np.array(count) for key, count in result.account.items()}
        write_npz(shards[name], {"successes": result.successes, **account})
    if len(failed) > params.label.max_failed * len(shards):
        raise LabelError(f"{len(failed)} of {len(shards)} objects failed, more than label.max_failed allows: {failed}")

    done = {name: read_npz(path) for name, path in shards.items() if name not in failed}
    write_npz(
        LABELS,
        {
            "ids": np.array(sorted(done)),
            "successes": np.stack([done[name]["successes"] for name in sorted(done)]),
            "attempts": np.array(params.label.attempts),
        },
    )
    rows = [
        {"id": name, "status": failed.get(name, "labelled")}
        | {key.removeprefix("account_"): int(v) for key, v in done.get(name, {}).items() if key.startswith("account_")}
        for name in sorted(shards)
    ]
    write_parquet(ACCOUNT, pd.DataFrame(rows))
    sweep("label_grasps", shards.values())


class LabelError(ValueError):
    """Too many objects could not be labelled."""


if __name__ == "__main__":
    main()
