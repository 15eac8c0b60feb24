"""The objects of a selection written to disk, with a manifest that says of each where it came from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import trimesh
from trimesh.exchange.ply import export_ply

from graspfn.meshes.store import MANIFEST

Row = dict[str, Any]
COLUMNS = {
    "id": "str",
    "source": "str",
    "name": "str",
    "class": "str",
    "family": "str",  # what a split by family keeps on one side
    "licence": "str",
    "split": "str",
    "shape": "str",  # the id of the first object of the split with this shape
    "signature": "object",  # (11,) of the shape
    "nearest": "str",  # of a test object, the training object that comes nearest to its shape; else ""
    "nearest_distance": "float64",  # mean distance of the two surfaces laid on each other, in sizes of that one; or NaN
    "scale": "float64",  # the mesh's own units to those of the object
    "size_m": "float64",  # largest extent along the mesh's own axes
    "volume_m3": "float64",  # what the mass is reckoned from
    "mass": "str",  # of the "volume" of the mesh, or of its "convex hull"
    "watertight": "bool",
    "faces": "int64",
    "collision_faces": "int64",
    "cleaning": "str",  # what was done to the mesh
    "seed_index": "int64",  # position among the candidates of its split
}


@dataclass(frozen=True, eq=False)
class Object:
    """An object of the selection: its line of the manifest, and meshes in metres about its centre of mass."""

    row: Row
    mesh: trimesh.Trimesh
    collision: trimesh.Trimesh


def write_objects(folder: Path, collisions: Path, objects: Iterable[Object]) -> pd.DataFrame:
    """Write objects one by one, their meshes into one folder and their collision meshes into another.

    The manifest, sorted by id, is written last and returned.
    """
    (folder / MANIFEST).unlink(missing_ok=True)
    for place in (folder, collisions):
        place.mkdir(parents=True, exist_ok=True)
        for stale in place.glob("*.ply"):  # of an earlier run with other parameters
            stale.unlink()
    rows = []
    for drawn in objects:
        for place, mesh in ((folder, drawn.mesh), (collisions, drawn.collision)):
            (place / f"{drawn.row['id']}.ply").write_bytes(export_ply(mesh, vertex_normal=False))
        rows.append(drawn.row)
    manifest = pd.DataFrame(rows, columns=list(COLUMNS)).astype(COLUMNS)
    manifest = manifest.sort_values("id", ignore_index=True)
    manifest.to_parquet(folder / MANIFEST, index=False)
    return manifest
