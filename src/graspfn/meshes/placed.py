"""The table of placed objects that stage place_objects writes: where each came to rest, or why it did not."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import trimesh
from scipy.spatial.transform import Rotation

from graspfn.meshes.store import load_object
from graspfn.workflow.files import write_parquet

RESTING = "resting"
COLUMNS = ("id", "class", "status", "fit_scale", "qw", "qx", "qy", "qz", "x", "y", "z")


@dataclass(frozen=True, eq=False)
class Resting:
    """An object at rest on the table.

    mesh: what is seen and weighed, metres about its centre of mass; collision: what of it a gripper touches;
    T_world_object: (4, 4) resting pose.
    """

    mesh: trimesh.Trimesh
    collision: trimesh.Trimesh
    T_world_object: np.ndarray


def placed_row(
    name: str, category: str, status: str, T_world_object: np.ndarray, fit_scale: float = 1.0
) -> dict[str, Any]:
    """One line of the table: the status, "resting" or why not, and T_world_object as quaternion and position (m).

    fit_scale: of the stored mesh, to have the size at which it rests there: 1, or less so that it fits the gripper.
    """
    quaternion = Rotation.from_matrix(T_world_object[:3, :3]).as_quat(scalar_first=True, canonical=True)
    values = (name, category, status, float(fit_scale), *quaternion.tolist(), *T_world_object[:3, 3].tolist())
    return dict(zip(COLUMNS, values, strict=True))


def write_placed(path: Path, rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Write the table, sorted by id, and return it."""
    table = pd.DataFrame(rows, columns=list(COLUMNS)).sort_values("id", ignore_index=True)
    write_parquet(path, table)
    return table


def read_resting(path: Path) -> pd.DataFrame:
    """The objects that came to rest, sorted by id."""
    table = pd.read_parquet(path)
    return table[table["status"] == RESTING].reset_index(drop=True)


def resting_rows(path: Path) -> dict[str, dict[Hashable, Any]]:
    """Lines of the objects that came to rest, by id and in its order."""
    return {row["id"]: row for row in read_resting(path).to_dict("records")}


def T_world_object(row: Mapping[Any, Any]) -> np.ndarray:
    """(4, 4) resting pose of a line of the table."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat([row["qw"], row["qx"], row["qy"], row["qz"]], scalar_first=True).as_matrix()
    T[:3, 3] = row["x"], row["y"], row["z"]
    return T


def load_placed(folder: Path, row: Mapping[Any, Any]) -> trimesh.Trimesh:
    """A mesh of the object of a line of the table, at the size at which it was placed, from its folder (store.py)."""
    mesh = load_object(folder, row["id"])
    return trimesh.Trimesh(mesh.vertices * row["fit_scale"], mesh.faces, process=False)


def load_resting(meshes: Path, collisions: Path, row: Mapping[Any, Any]) -> Resting:
    """The object of a line of the table, from the folders of its meshes."""
    return Resting(load_placed(meshes, row), load_placed(collisions, row), T_world_object(row))
