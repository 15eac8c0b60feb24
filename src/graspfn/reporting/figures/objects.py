"""Contact sheets: every selected object as it came to rest, a sheet for each source of meshes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import trimesh

from graspfn.meshes.placed import RESTING, T_world_object, load_placed
from graspfn.meshes.store import read_manifest
from graspfn.reporting.figures.contact_sheet import Cells, cells_for, draw_contact_sheet
from graspfn.reporting.figures.shading import OBJECT_COLOUR, View, render_scene
from graspfn.reporting.figures.style import Plate
from graspfn.reporting.sizes import reasons

HEADINGS = {"train": "Training objects", "test": "Test objects"}
TO_EYE = np.array([0.40, -0.66, 0.63])  # from the object
FAR = 2.7  # the eye from the object, in widths of the picture
ROOM = 1.5  # width of the picture over the largest extent of an object, whose diagonals are longer
MOST_CLASSES = 40  # more than so many would make a caption of their own


def selected(data: Path) -> pd.DataFrame:
    """Manifest and resting pose of every object, training objects first, each split by class and then id.

    status: NaN for an object that stage place_objects never saw.
    """
    tables = []
    for split in HEADINGS:
        manifest = read_manifest(data / "objects" / split)
        placed = pd.read_parquet(data / "placed" / f"{split}.parquet").drop(columns="class")
        tables.append(manifest.merge(placed, on="id", how="left").sort_values(["class", "id"]))
    return pd.concat(tables, ignore_index=True)


def picture(mesh: trimesh.Trimesh, T_world_object: np.ndarray, width_m: float, side_px: int) -> np.ndarray:
    """(side_px, side_px, 3) uint8: an object in the middle of a view that is width_m wide there."""
    settled = mesh.copy().apply_transform(T_world_object)
    target = settled.bounds.mean(axis=0)
    view = View(tuple(target + FAR * width_m * TO_EYE), tuple(target), width_m, side_px, side_px)
    return np.round(255 * render_scene([(settled, OBJECT_COLOUR)], view)).astype(np.uint8)


def _pictures(data: Path, resting: pd.DataFrame, side_px: int) -> Iterator[np.ndarray]:
    """A picture of every line, all at one scale; no more than one mesh is in memory."""
    width_m = ROOM * float((resting["size_m"] * resting["fit_scale"]).max())
    for row in resting.to_dict("records"):
        yield picture(load_placed(data / "objects" / row["split"], row), T_world_object(row), width_m, side_px)


def _caption(source: str, resting: pd.DataFrame, left_out: Mapping[str, int], cells: Cells) -> str:
    splits = resting["split"].value_counts()
    sentences = [
        f"The objects of source {source} as they came to rest: {splits.get('train', 0):,} to train on, "
        f"{splits.get('test', 0):,} to test on. All at one scale: lines on the table are 5 cm apart."
    ]
    if left_out:
        why = ", ".join(f"{count:,} {reason}" for reason, count in left_out.items())
        sentences.append(f"Left out and not shown: {why}.")
    classes = [name.replace("_", " ") for name in sorted(set(resting["class"])) if name]
    if not cells.lines and 1 < len(classes) <= MOST_CLASSES:
        sentences.append(f"In the order of their classes: {', '.join(classes)}.")
    return " ".join(sentences)


def contact_sheets(data: Path) -> Iterator[Plate]:
    """A figure objects_<source> for each source of data/objects, of every object at rest in data/placed."""
    for source, objects in selected(data).groupby("source"):
        resting = objects[objects["status"] == RESTING]
        if resting.empty:
            continue
        groups = [
            (f"{heading} ({len(rows):,})", rows["name"].tolist())
            for split, heading in HEADINGS.items()
            if len(rows := resting[resting["split"] == split])
        ]
        cells = cells_for(groups)
        figure = draw_contact_sheet(groups, cells, _pictures(data, resting, cells.side_px))
        caption = _caption(str(source), resting, reasons(objects["status"].fillna("not placed")), cells)
        yield Plate(f"objects_{source}", caption, figure, palette=True)
