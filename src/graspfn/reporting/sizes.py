"""How large objects are: as they were drawn, as they were placed, and how wide where a hand would take them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import trimesh

from graspfn.geometry.transforms import apply
from graspfn.meshes.placed import RESTING, T_world_object, load_placed

AS_DRAWN, SMALLER = "as drawn", "made smaller"
ANGLES = np.radians(np.arange(180))


def narrowest_width(mesh: trimesh.Trimesh, T_world_object: np.ndarray) -> float:
    """Metres: the least width of an object at rest as it is seen from above, over all angles."""
    points = apply(T_world_object, mesh.vertices)[:, :2]
    return float(min(np.ptp(points @ (np.cos(angle), np.sin(angle))) for angle in ANGLES))


def widths(meshes: Path, placed: pd.DataFrame) -> dict[str, float]:
    """Of every object at rest, by id, metres; meshes: their folder; placed: lines of data/placed."""
    rows = placed[placed["status"] == RESTING].to_dict("records")
    return {row["id"]: narrowest_width(load_placed(meshes, row), T_world_object(row)) for row in rows}


def reasons(status: pd.Series) -> dict[str, int]:
    """Why objects were left out and how many, by name; of a reason only what stands before its particulars."""
    left = status[status != RESTING].str.split(":").str[0]
    return {str(reason): int(count) for reason, count in left.value_counts().sort_index().items()}


def sizes(manifests: Mapping[str, pd.DataFrame], placed: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Of every object of every split: id, split, drawn_m and placed_m, its largest extent before and after, and fate.

    fate: AS_DRAWN, SMALLER, or the reason why it was left out, whose placed_m is NaN.
    """
    tables = []
    for split, manifest in manifests.items():
        table = manifest[["id", "size_m"]].merge(placed[split][["id", "status", "fit_scale"]], on="id")
        rests = table["status"] == RESTING
        fate = np.where(table["fit_scale"] < 1, SMALLER, AS_DRAWN)
        columns = {
            "id": table["id"],
            "split": split,
            "drawn_m": table["size_m"],
            "placed_m": (table["size_m"] * table["fit_scale"]).where(rests),
            "fate": np.where(rests, fate, table["status"].str.split(":").str[0]),
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def size_statistics(table: pd.DataFrame) -> dict[str, Any]:
    """For each split: how many objects had which fate, and quartiles of their size before and after, cm."""
    result: dict[str, Any] = {}
    for split, own in table.groupby("split"):
        counts = own["fate"].value_counts()
        entry: dict[str, Any] = {"selected": len(own)}
        entry |= {key: int(counts.get(fate, 0)) for key, fate in (("as_drawn", AS_DRAWN), ("made_smaller", SMALLER))}
        left = own.loc[own["placed_m"].isna(), "fate"].value_counts().sort_index()
        entry["left_out"] = {str(reason): int(count) for reason, count in left.items()}
        for column in ("drawn_m", "placed_m"):
            low, middle, high = own[column].quantile([0.25, 0.5, 0.75]) * 100
            name = column.removesuffix("_m")
            entry[f"{name}_cm"] = {"lower_quartile": low, "median": middle, "upper_quartile": high}
        result[str(split)] = entry
    return result
