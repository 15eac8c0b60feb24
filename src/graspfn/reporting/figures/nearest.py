"""The nearest pair across the split: the test object that is most like a training object."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from graspfn.meshes.placed import RESTING, T_world_object, load_placed
from graspfn.reporting.figures.objects import ROOM, picture
from graspfn.reporting.figures.style import COLUMN_IN, Plate, bare, new_figure, styled

SIDE_PX = 360


@styled
def draw_pair(pictures: Mapping[str, np.ndarray]) -> Figure:
    """Two pictures (side, side, 3) side by side, each under its name."""
    figure = new_figure(COLUMN_IN + 1, 2.4)
    for axes, (name, image) in zip(figure.subplots(1, 2), pictures.items(), strict=True):
        axes.imshow(image, interpolation="antialiased")
        axes.set_title(name, fontsize=8, parse_math=False)
        bare(axes)
    return figure


def _picture(data: Path, placed: pd.DataFrame, split: str, name: str) -> np.ndarray:
    """At its own scale: two shapes are compared, not two sizes."""
    row = placed[placed["id"] == name].iloc[0].to_dict()
    mesh = load_placed(data / "objects" / split, row)
    return picture(mesh, T_world_object(row), ROOM * float(mesh.extents.max()), SIDE_PX)


def plates(data: Path, manifests: Mapping[str, pd.DataFrame], placed: Mapping[str, pd.DataFrame]) -> Iterator[Plate]:
    """One figure, where both came to rest: of the objects shown, those whose surfaces lie nearest to each other."""
    test = manifests["test"]
    rests = {split: set(table.loc[table["status"] == RESTING, "id"]) for split, table in placed.items()}
    shown = test[test["id"].isin(rests["test"]) & test["nearest"].isin(rests["train"])]
    if shown.empty:
        return
    line = shown.sort_values("nearest_distance").iloc[0]
    pair = {
        f"train: {line['nearest']}": _picture(data, placed["train"], "train", line["nearest"]),
        f"test: {line['id']}": _picture(data, placed["test"], "test", line["id"]),
    }
    yield Plate(
        "nearest_pair",
        f"The nearest pair across the split: of all test objects, {line['id']} is most like a training object, "
        f"{line['nearest']}. Laid on each other, their surfaces lie {100 * line['nearest_distance']:.2g} % of its size "
        f"apart on average; of the median test object and its nearest, "
        f"{100 * test['nearest_distance'].median():.2g} %. Each at its own scale.",
        draw_pair(pair),
    )
