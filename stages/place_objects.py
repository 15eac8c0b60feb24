"""Let every object come to rest on the table in a random orientation."""

from pathlib import Path

import numpy as np
import trimesh

from graspfn.meshes.placed import RESTING, placed_row, write_placed
from graspfn.meshes.store import load_object, read_manifest
from graspfn.params import Declared, Physics, Settle
from graspfn.physics.settling import Settled, settle
from graspfn.workflow.parallel import map_objects
from graspfn.workflow.seeds import generator
from graspfn.workflow.stage import stage

OBJECTS, OUT = Path("data/objects"), Path("data/placed")


class PlacementError(ValueError):
    """Nothing to see or to grasp."""


def settle_object(name: str, mesh: trimesh.Trimesh, physics: Physics, settling: Settle, seed: int) -> Settled:
    return settle(mesh, physics, settling, generator(seed, "place_objects", name))


@stage("place_objects")
def main(params: Declared) -> None:
    manifests = {split: read_manifest(OBJECTS / split) for split in ("train", "test")}
    tasks = (
        (name, (name, load_object(OBJECTS / split, name), params.physics, params.settle, params.seed))
        for split, manifest in manifests.items()
        for name in manifest["id"]
    )
    settled = dict(map_objects(settle_object, tasks, sum(map(len, manifests.values())), params.compute, "settle"))
    for split, manifest in manifests.items():
        rows = []
        for row in manifest.to_dict("records"):
            result = settled[row["id"]]
            if isinstance(result, Exception):  # its worker died three times
                result = Settled(str(result), np.eye(4))
            rows.append(placed_row(row["id"], row["class"], result.status, result.T_world_object))
        table = write_placed(OUT / f"{split}.parquet", rows)
        if not (table["status"] == RESTING).any():
            raise PlacementError(f"{split}: none of {len(table)} objects came to rest ({table['status'].iloc[0]}, ...)")
        print(f"{split}: {(table['status'] == RESTING).sum()} of {len(table)} objects rest")
        for left in table[table["status"] != RESTING].itertuples():
            print(f"left out {left.id}: {left.status}")


if __name__ == "__main__":
    main()
