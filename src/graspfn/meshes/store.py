"""Objects on disk: one PLY in metres for each, and a manifest that says where it came from."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pandas as pd
import trimesh
from trimesh.exchange.ply import export_ply

from graspfn.meshes.errors import MeshError
from graspfn.meshes.folder import read_mesh

MANIFEST = "manifest.parquet"
COLUMNS = {
    "id": "str",
    "source": "str",
    "name": "str",
    "class": "str",
    "scale": "float64",  # units of the file to metres
    "size_m": "float64",  # largest extent along the mesh's own axes
    "volume_m3": "float64",  # what the mass is reckoned from: the convex hull's where cleaning is "hull mass"
    "watertight": "bool",
    "faces": "int64",
    "cleaning": "str",
    "seed_index": "int64",  # position among the candidates of its split
}


def write_objects(folder: Path, objects: Iterable[tuple[dict[str, Any], trimesh.Trimesh]]) -> pd.DataFrame:
    """Write (row, mesh) pairs one by one into a folder; its manifest, sorted by id, is written last and returned."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MANIFEST).unlink(missing_ok=True)
    for stale in folder.glob("*.ply"):  # of an earlier run with other parameters
        stale.unlink()
    rows = []
    for row, mesh in objects:
        (folder / f"{row['id']}.ply").write_bytes(export_ply(mesh, vertex_normal=False))
        rows.append(row)
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
    """The mesh of an object, metres about its centre of mass, vertices and faces exactly as stored."""
    return read_mesh(folder / f"{object_id}.ply")
