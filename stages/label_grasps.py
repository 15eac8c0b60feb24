"""Attempt a grasp at every pose of Q of the objects of a split: to learn from, or as the true function (paper IV-C)."""

from collections.abc import Container
from pathlib import Path

import numpy as np
import pandas as pd

from graspfn.geometry.grid import SHAPE
from graspfn.meshes.placed import Resting, load_resting, resting_rows
from graspfn.meshes.store import read_manifest
from graspfn.params import Declared
from graspfn.physics.labelling import Labels, joined, label_object, successes
from graspfn.physics.world import Rig
from graspfn.seeds import seed_of
from graspfn.workflow.files import write_npz, write_parquet
from graspfn.workflow.resume import Arrays, each_object
from graspfn.workflow.shards import code_digest, shard_key, shard_path
from graspfn.workflow.stage import stage

OBJECTS, COLLISION, PLACED, OUT = (Path("data") / name for name in ("objects", "collision", "placed", "labels"))
ANGLES = SHAPE[2]  # an object is labelled in as many parts, so that one large object does not keep one core busy alone


def label_part(angle: int, resting: Resting, attempts: int, rig: Rig, seed: int) -> Labels:
    return label_object(resting, attempts, rig, np.random.default_rng(seed), slice(angle, angle + 1))


def packed(parts: list[Labels]) -> Arrays:
    labels = joined(parts)
    return {"outcomes": labels.outcomes} | {f"account_{key}": np.array(n) for key, n in labels.account.items()}


def wanted(split: str, placed: Container[str], first: int) -> list[str]:
    """Names of the placed objects to label: all to train on, but of those to test on the first that were selected."""
    order = read_manifest(OBJECTS / split).sort_values("seed_index")["id"]
    names = [name for name in order if name in placed]
    return names if split == "train" else names[:first]


@stage("label_grasps")
def main(params: Declared) -> None:
    split, attempts, rig = params.items[0], params.label.attempts, Rig(params.physics, params.gripper, params.attempt)
    folders = OBJECTS / split, COLLISION / split
    placed = resting_rows(PLACED / f"{split}.parquet")
    names = wanted(split, placed, params.label.test)
    seeds = {name: seed_of(params.seed, "label_grasps", name) for name in names}
    code = code_digest("seeds.py", "geometry", "meshes", "physics")
    shards = {}
    for name in names:
        files = [folder / f"{name}.ply" for folder in folders]
        key = shard_key(name, *files, placed[name], attempts, rig, seeds[name], code, Path(__file__))
        shards[name] = shard_path(f"label_grasps@{split}", key)

    def tasks(name: str) -> list[tuple[int, Resting, int, Rig, int]]:
        resting = load_resting(*folders, placed[name])
        return [(angle, resting, attempts, rig, seeds[name]) for angle in range(ANGLES)]

    done, failed = each_object(
        f"label_grasps@{split}",
        shards,
        label_part,
        tasks,
        packed,
        params.compute,
        params.label.max_failed,
        parts=ANGLES,
        attempts=lambda part: part.simulated,
    )
    ids = sorted(done)
    outcomes = np.stack([done[name]["outcomes"] for name in ids])
    arrays = {"ids": np.array(ids), "outcomes": outcomes, "successes": successes(outcomes)}
    arrays |= {"attempts": np.array(attempts), "seeds": np.array([seeds[name] for name in ids], dtype=np.uint64)}
    write_npz(OUT / f"{split}.npz", arrays)
    rows = []
    for name in sorted(names):
        account = {key.removeprefix("account_"): int(n) for key, n in done.get(name, {}).items() if n.ndim == 0}
        best = int(successes(done[name]["outcomes"]).max()) if name in done else 0  # that held at the best pose
        rows.append({"id": name, "status": failed.get(name, "labelled"), "best": best} | account)
    write_parquet(OUT / f"{split}.parquet", pd.DataFrame(rows))


if __name__ == "__main__":
    main()
