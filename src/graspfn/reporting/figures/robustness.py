"""Success, and plans that stay, against each disturbance of the depth image."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from graspfn.evaluation.planner import TRUE
from graspfn.imaging.disturbances import CLEAN
from graspfn.planning.methods import BEST, CENTROID, ROBUST
from graspfn.reporting.figures.style import COLOURS, MARKERS, WIDE_IN, Plate, new_figure, styled

COLUMNS = 4
MOST = 1.03  # of an axis of rates: a mark at 1 stays whole
MEASURES = {"expected": "expected success", "stay_share": "plans that stay"}


def of_network(table: pd.DataFrame, network: str) -> pd.DataFrame:
    """The rows of a network and of Centroid, of disturbances with two amounts or more, each with its clean row at 0."""
    own = table[table["network"].isin(["", network])]
    clean = own[own["disturbance"] == CLEAN]
    found = []
    for name, rows in own.groupby("disturbance", sort=False):
        if rows["amount"].nunique() > 1:
            found += [rows, clean.assign(disturbance=name, unit=rows["unit"].iloc[0])]
    return pd.concat(found, ignore_index=True) if found else own.iloc[:0]


@styled
def draw_robustness(table: pd.DataFrame, network: str) -> Figure:
    """A pair of panels for each disturbance; solid with the table found, dashed with the camera's pose believed."""
    rows = of_network(table, network)
    names = list(dict.fromkeys(rows["disturbance"]))
    blocks = -(-len(names) // COLUMNS)
    figure = new_figure(WIDE_IN, 3.6 * blocks + 0.5)
    panels = figure.subplots(2 * blocks, COLUMNS, sharey=True, squeeze=False)
    for axes in panels.flat:
        axes.set_visible(False)
    for i, name in enumerate(names):
        own = rows[rows["disturbance"] == name]
        for k, measure in enumerate(MEASURES):
            axes = panels[2 * (i // COLUMNS) + k, i % COLUMNS]
            axes.set_visible(True)
            for (method, fit), line in own.groupby(["method", "table_fit"]):
                line = line.sort_values("amount")
                look = {"color": COLOURS[method], "marker": MARKERS[method], "markersize": 3.5}
                axes.plot(line["amount"], line[measure], linestyle="-" if fit else "--", **look)
            axes.set_ylim(0, MOST)
            axes.grid(axis="y")
            axes.set_title(name if k == 0 else "")
            axes.set_xlabel(own["unit"].iloc[0] if k else "")
            if i % COLUMNS == 0:
                axes.set_ylabel(MEASURES[measure])
    methods = [name for name in (CENTROID, BEST, ROBUST) if name in set(rows["method"])]
    handles = [Line2D([], [], label=name, color=COLOURS[name], marker=MARKERS[name]) for name in methods]
    handles += [
        Line2D([], [], label="table found in the image", color="0.3"),
        Line2D([], [], label="camera's pose believed", color="0.3", linestyle="--"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=3, title=network)
    return figure


def plates(table: pd.DataFrame, networks: list[str]) -> Iterator[Plate]:
    """One for every network, the best one first; table: of robustness."""
    planned = int(table["planned"].max())
    for i, network in enumerate(name for name in networks if name != TRUE):
        yield Plate(
            "robustness" if i == 0 else f"robustness_{network}",
            f"Robustness of {network} on {planned:,} test objects: success to expect of the plans by the attempts of "
            "labels, and share of plans within 1 cm and 15° of that on the clean image, against each disturbance of "
            "the depth image. Solid: the table is found in the image; dashed: the camera's pose is believed. The table "
            "of robustness has trials in simulation beside them, with intervals.",
            draw_robustness(table, network),
        )
