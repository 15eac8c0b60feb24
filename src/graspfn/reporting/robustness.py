"""The table of robustness: what becomes of plans on disturbed depth images, with the table found and believed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from graspfn.evaluation.expected import FEW
from graspfn.evaluation.planner import TRUE
from graspfn.evaluation.statistics import Resampled, resampled, resampled_rate
from graspfn.imaging.disturbances import CLEAN
from graspfn.planning.methods import METHODS
from graspfn.reporting.layout import BLANK, Block, Cell, Layout, Row, number
from graspfn.reporting.tables import full_name

COLUMNS = [
    "disturbance",
    "amount",
    "unit",
    "method",
    "network",
    "table_fit",
    "success",
    "ci_low",
    "ci_high",
    "stay_share",
    "highest_score",
    "trials",
    "objects",
    "expected",
    "expected_change",
    "change_low",
    "change_high",
    "planned",
    "refused",
]
SHOT = ["disturbance", "amount", "unit"]
_KEY = [*SHOT, "table_fit", "method", "network"]


def _per_object(plans: pd.DataFrame, values: pd.Series) -> pd.DataFrame:
    """A line for every object, a column for every training seed; only objects known for all of these."""
    table = plans.assign(value=values).pivot_table(index="id", columns="training_seed", values="value")
    return table.dropna()


def expectations(plans: pd.DataFrame) -> pd.Series:
    """Success of each plan by the attempts of its object's labels: NaN where these say too little.

    Where there is no plan it is 0, as nobody tries anything.
    """
    labelled = plans["id"].isin(plans.loc[plans["expected"].notna(), "id"])
    known = plans["expected"].where(plans["effective"] >= FEW)
    return known.mask(plans["u_m"].isna() & labelled, 0.0)


def _tried(plans: pd.DataFrame) -> dict[str, Any]:
    own = plans[plans["trials"] > 0]
    if own.empty:
        return {"success": np.nan, "ci_low": np.nan, "ci_high": np.nan, "trials": 0, "objects": 0}
    rate = resampled_rate(_per_object(own, own["held"] / own["trials"]).to_numpy())
    found = {"success": rate.value, "ci_low": rate.low, "ci_high": rate.high}
    return found | {"trials": int(own["trials"].sum()), "objects": rate.objects}


def _change(now: pd.DataFrame, before: pd.DataFrame) -> Resampled | None:
    """Of expected success against the clean images, on the objects for which both are known."""
    both = now.index.intersection(before.index)
    return resampled(now.loc[both].to_numpy() - before.loc[both].to_numpy()) if len(both) else None


def robustness_table(plans: pd.DataFrame) -> pd.DataFrame:
    """A row for every disturbance, amount, method and way to have the table (COLUMNS); plans: data/robustness.parquet.

    success, ci_low, ci_high: of trials in simulation, on `objects`. expected: success by the attempts of labels, on the
    labelled ones, not of the true function; expected_change: that less its own on clean images, with its interval.
    stay_share: of the `planned` objects. refused: plans for which the image was turned down. highest_score: of the
    network on an empty table seen with the same disturbance, the highest over its draws.
    """
    plans = plans.assign(known=expectations(plans))
    empty = plans[plans["empty"]].groupby(_KEY)["highest"].max()
    objects = plans[~plans["empty"]]
    clean = {
        key: _per_object(group, group["known"])
        for key, group in objects[objects["disturbance"] == CLEAN].groupby(_KEY[3:])
    }
    rows: list[dict[str, Any]] = []
    for key, group in objects.groupby(_KEY, sort=False):
        known = _per_object(group, group["known"])
        change = _change(known, clean[key[3:]])
        row = dict(zip(_KEY, key, strict=True)) | _tried(group)
        row |= {"stay_share": float(group["stays"].mean()), "highest_score": float(empty.get(key, np.nan))}
        row |= {"expected": float(known.to_numpy().mean()) if len(known) else np.nan}
        values = (np.nan,) * 3 if change is None else (change.value, change.low, change.high)
        row |= dict(zip(("expected_change", "change_low", "change_high"), values, strict=True))
        row |= {"planned": group["id"].nunique(), "refused": int((group["refused"] != "").sum())}
        rows.append(row)
    order = {shot: i for i, shot in enumerate(objects[SHOT].drop_duplicates().itertuples(index=False, name=None))}

    def place(row: dict[str, Any]) -> tuple[Any, ...]:
        shot = order[tuple(row[name] for name in SHOT)]
        return shot, not row["table_fit"], METHODS.index(row["method"]), row["network"] == TRUE, row["network"]

    rows.sort(key=place)
    return pd.DataFrame(rows, columns=COLUMNS)


def shot_name(disturbance: str, amount: float, unit: str) -> str:
    """offset +2 mm; camera azure_kinect, 600 mm high."""
    if disturbance in (CLEAN, "other noise"):
        return disturbance
    if disturbance.startswith("camera ") and disturbance != "camera height":
        return f"{disturbance}, {amount:g} {unit}"
    signed = disturbance in ("offset", "scale", "camera height")
    return f"{disturbance} {amount:{'+' if signed else ''}g} {unit}"


def _cells(table: pd.DataFrame, methods: list[tuple[str, str]]) -> Iterator[Cell]:
    """Of one disturbance and way to have the table: success, expected and stay_share of every method."""
    for method, network in methods:
        line = table[(table["method"] == method) & (table["network"] == network)]
        if line.empty:
            yield from (Cell(BLANK),) * 3
            continue
        one = line.iloc[0]
        interval = "" if np.isnan(one["success"]) else f"[{number(one['ci_low'], 2)}, {number(one['ci_high'], 2)}]"
        yield Cell(number(one["success"], 2), interval)
        yield Cell(number(one["expected"], 2))
        yield Cell(number(one["stay_share"], 2))


def layout_robustness(table: pd.DataFrame, caption: str) -> Layout:
    """A row for every disturbance and amount, a block with the table found and one with it believed."""
    shown = table[table["network"] != TRUE]
    methods = list(shown[["method", "network"]].drop_duplicates().itertuples(index=False, name=None))
    networks = sorted(set(shown["network"]) - {""})
    groups = [(full_name(*method), ("success", "expected", "stays")) for method in methods]
    groups.append(("empty table, highest score", tuple(networks)))
    blocks = []
    for fit, heading in ((True, "The table found in the image"), (False, "The camera's pose believed")):
        rows: list[Row] = []
        before = ""
        of_fit = shown[shown["table_fit"] == fit]
        for shot in of_fit[SHOT].drop_duplicates().itertuples(index=False, name=None):
            group = of_fit[(of_fit[SHOT] == list(shot)).all(axis=1)]
            highest = [group.loc[group["network"] == network, "highest_score"].max() for network in networks]
            cells = (*_cells(group, methods), *(Cell(number(score, 2)) for score in highest))
            rows.append(Row(shot_name(*shot), cells, ours=True, first=shot[0] != before))
            before = shot[0]
        blocks.append(Block(heading, tuple(rows)))
    return Layout(caption, tuple(groups), tuple(blocks))


def ceiling(table: pd.DataFrame) -> str:
    """What the same trials say of the labels of the very object, which no disturbance reaches; "" without labels."""
    own = table[(table["network"] == TRUE) & table["success"].notna()]
    said = ", ".join(f"{line['method']} {number(line['success'], 2)}" for line in own.to_dict("records"))
    return f"On the true function, which no camera disturbs: {said}. " if said else ""


def caption_robustness(table: pd.DataFrame, disturb: Any, scale: str) -> str:
    """What the table shows, with its counts; disturb: its parameters."""
    trials, objects, planned = (int(table[name].max()) for name in ("trials", "objects", "planned"))
    refused = table[table["network"] != TRUE]
    count, of = int(refused["refused"].sum()), int(refused["planned"].sum())
    turned_down = f"For {count:,} of the {of:,} plans the image was refused, which is no grasp. " if count else ""
    return (
        f"Robustness (ours, not the paper's), scale “{scale}”: disturbed depth images of {planned:,} test "
        f"object{'s' * (planned != 1)}, "
        "with the table found in the image and with the camera's pose believed; each plan is executed with "
        f"σuv = {disturb.sigma_uv_mm:g} mm, σθ = {disturb.sigma_theta_deg:g}°. Success: of at most {trials:,} trials "
        f"in simulation on {objects:,} objects, the same errors in every row; brackets are 95% intervals. "
        "Expected: the success of the commanded poses by the objects' own labelled attempts, which is far more "
        "precise. Stays: share of plans within 1 cm and 15° of that on the clean image. Highest score: of any pose, on "
        f"an empty table seen with the same disturbance. {turned_down}{ceiling(table)}"
        "Offset: the camera is higher than it is believed to be. Tilt: it looks elsewhere, from a place that is known. "
        "Camera height: moved, and known to be. Other noise: nothing but another draw of it."
    )
