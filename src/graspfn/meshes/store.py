"""Objects on disk: two PLY in metres for each, to see and to touch, and a manifest that says where it came from."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import trimesh

from graspfn.meshes.errors import MeshError

MANIFEST = "manifest.parquet"


def read_manifest(folder: Path) -> pd.DataFrame:
    """One row per object of a folder, sorted by id, as stage select_meshes writes it."""
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
