"""Attempt a grasp at every pose of Q of every training object (paper III-C)."""

from pathlib import Path

import numpy as np
import pandas as pd
import trimesh

from graspfn.geometry.grid import SHAPE
from graspfn.meshes.placed import T_world_object, read_resting
from graspfn.meshes.store import load_object
from graspfn.params import Attempt, Declared, Gripper, Label, Physics
from graspfn.physics.labelling import Labels, joined, label_object
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


def label_part(
    name: str,
    angle: int,
    meshes: tuple[trimesh.Trimesh, trimesh.Trimesh],
    T: np.ndarray,
    what: tuple[Label, Physics, Gripper, Attempt],
    seed: int,
) -> Labels:
    labels, physics, gripper, attempt = what
    rng, angles = generator(seed, "label_grasps", name), slice(angle, angle + 1)
    return label_object(*meshes, T, labels.attempts, physics, gripper, attempt, rng, angles)


@stage("label_grasps")
def main(params: Declared) -> None:
    what = (params.label, params.physics, params.gripper, params.attempt)
    code = code_digest("workflow", "geometry", "meshes", "physics")
    placed = read_resting(PLACED).set_index("id", drop=False)
    poses = {row["id"]: T_world_object(row) for row in placed.to_dict("records")}
    shards = {}
    for name, T in poses.items():
        files = [folder / f"{name}.ply" for folder in (MESHES, COLLISION)]
        key = shard_key(name, *files, T.tolist(), what, params.seed, code, Path(__file__))
        shards[name] = shard_path("label_grasps", key)
    todo = [name for name, path in shards.items() if not path.exists()]
    if len(todo) < len(shards):
        print(f"{len(shards) - len(todo)} of {len(shards)} objects were labelled before")
    tasks = (
        (f"{name}/{angle}", (name, angle, meshes, poses[name], what, params.seed))
        for name in todo
        for meshes in [(load_object(MESHES, name), load_object(COLLISION, name))]
        for angle in range(ANGLES)
    )
    parts: dict[str, dict[int, Labels]] = {name: {} for name in todo}
    failed = {}
    for task, result in map_objects(label_part, tasks, len(todo) * ANGLES, params.compute, "label", "angle"):
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
