"""Let every object come to rest on the table in a random orientation, at a size that fits the gripper (paper IV-C)."""

from pathlib import Path

import numpy as np
import trimesh

from graspfn.meshes.placed import RESTING, placed_row, write_placed
from graspfn.meshes.store import load_object, read_manifest
from graspfn.params import Declared, Gripper, Physics, Settle
from graspfn.physics.fitting import Placed, place
from graspfn.physics.gripper import Kinematics
from graspfn.seeds import generator
from graspfn.workflow.parallel import map_objects
from graspfn.workflow.stage import stage

OBJECTS, OUT = Path("data/objects"), Path("data/placed")


class PlacementError(ValueError):
    """Nothing to see or to grasp."""


def place_object(
    name: str, mesh: trimesh.Trimesh, gripper: Gripper, smallest_m: float, physics: Physics, settling: Settle, seed: int
) -> Placed:
    rng = generator(seed, "place_objects", name)
    return place(mesh, Kinematics.from_params(gripper), smallest_m, physics, settling, rng)


@stage("place_objects")
def main(params: Declared) -> None:
    manifests = {split: read_manifest(OBJECTS / split) for split in ("train", "test")}
    how = params.gripper, params.meshes.size_min_cm / 100, params.physics, params.settle, params.seed
    tasks = (
        (name, (name, load_object(OBJECTS / split, name), *how))
        for split, manifest in manifests.items()
        for name in manifest["id"]
    )
    placed = dict(map_objects(place_object, tasks, sum(map(len, manifests.values())), params.compute, "settle"))
    for split, manifest in manifests.items():
        rows = []
        for row in manifest.to_dict("records"):
            result = placed[row["id"]]
            if isinstance(result, Exception):  # its worker died three times
                result = Placed(str(result), np.eye(4))
            rows.append(placed_row(row["id"], row["class"], result.status, result.T_world_object, result.fit_scale))
        table = write_placed(OUT / f"{split}.parquet", rows)
        if not (table["status"] == RESTING).any():
            raise PlacementError(f"{split}: none of {len(table)} objects came to rest ({table['status'].iloc[0]}, ...)")
        smaller = (table["fit_scale"] < 1).sum()
        print(
            f"{split}: {(table['status'] == RESTING).sum()} of {len(table)} objects rest, {smaller} made smaller to fit"
        )
        for left in table[table["status"] != RESTING].itertuples():
            print(f"left out {left.id}: {left.status}")


if __name__ == "__main__":
    main()
