"""Objects on disk: two PLY in metres for each, to see and to touch, and a manifest that says where it came from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import trimesh
from trimesh.exchange.ply import export_ply

from graspfn.meshes.errors import MeshError

Row = dict[str, Any]
MANIFEST = "manifest.parquet"
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


def read_manifest(folder: Path) -> pd.DataFrame:
    """One row per object of a folder, sorted by id, with the columns of COLUMNS."""
    path = folder / MANIFEST
    if not path.is_file():
        raise MeshError(f"{path}: no such file; stage select_meshes writes it")
    try:
        return pd.read_parquet(path)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())[:120]
        raise MeshError(f"{path}: cannot be read ({reason}); run stage select_meshes again") from None


def load_object(folder: Path, object_id: str) -> trimesh.Trimesh:
    """A mesh of an object, metres about its centre of mass, vertices and faces exactly as stored.

    From data/objects/<split> the one to see and to weigh, from data/collision/<split> the one to touch.
    """
    path = folder / f"{object_id}.ply"
    if not path.is_file():
        raise MeshError(f"{path}: no such file; stage select_meshes writes it")
    try:
        return trimesh.load_mesh(path, process=False, skip_materials=True)
    except Exception as error:  # of a damaged file, trimesh and numpy raise what they come across
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise MeshError(f"{path}: cannot be read ({reason}); run stage select_meshes again") from None
