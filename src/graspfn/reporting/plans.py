"""What was planned and what came of it: trials of one commanded pose together, objects in blocks, means over them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import pandas as pd

from graspfn.evaluation.expected import FEW
from graspfn.evaluation.planner import TRUE

ALL, GRASPABLE = "all", "graspable"  # blocks of objects
CELL = ["sigma_theta_deg", "sigma_uv_mm"]
PLAN = ["id", "method", "network", "training_seed", *CELL]


def graspable_objects(account: pd.DataFrame, attempts: int) -> frozenset[str]:
    """The objects with a pose at which every attempt held; account: of their labels (data/labels/test.parquet)."""
    sure = (account["status"] == "labelled") & (account["best"] == attempts)
    return frozenset(account.loc[sure, "id"])


def plans_of(trials: pd.DataFrame) -> pd.DataFrame:
    """A line for every pose that was commanded, with the columns of PLAN and those below; trials: data/trials.parquet.

    success: share of its trials; trials: their number; no_grasp: how many had no pose to try; promise; expected,
    expected_error: 0 where an object with attempts was given up, NaN where they are unknown or rest on too few; few:
    whether they would rest on fewer than FEW effective attempts.
    """
    plans = trials.groupby(PLAN, as_index=False).agg(
        success=("success", "mean"),
        trials=("success", "size"),
        no_grasp=("u_m", lambda u: int(u.isna().sum())),
        promise=("promise", "first"),
        expected=("expected", "first"),
        expected_error=("expected_error", "first"),
        effective=("effective", "first"),
    )
    plans["few"] = plans["expected"].notna() & (plans["effective"] < FEW)
    plans.loc[plans["few"], ["expected", "expected_error"]] = np.nan
    with_attempts = plans["id"].isin(plans.loc[plans["network"] == TRUE, "id"]) & (plans["network"] != TRUE)
    plans.loc[with_attempts & (plans["no_grasp"] > 0), ["expected", "expected_error"]] = 0.0
    return plans.drop(columns="effective")


def blocks(table: pd.DataFrame, graspable: Collection[str]) -> dict[str, pd.DataFrame]:
    """The lines of all objects, and of those that can be held where there are any; table: with the column id."""
    held = table[table["id"].isin(graspable)]
    return {ALL: table} | ({GRASPABLE: held} if len(held) else {})


def block_to_show(found: Mapping[str, Any]) -> str:
    """Those that can be held, where they are known."""
    return GRASPABLE if GRASPABLE in found else ALL


def of_cell(plans: pd.DataFrame, sigma_uv_mm: float, sigma_theta_deg: float) -> pd.DataFrame:
    return plans[(plans["sigma_uv_mm"] == sigma_uv_mm) & (plans["sigma_theta_deg"] == sigma_theta_deg)]


def of_method(plans: pd.DataFrame, method: str, network: str) -> pd.DataFrame:
    return plans[(plans["method"] == method) & (plans["network"] == network)]


def per_object(plans: pd.DataFrame) -> pd.DataFrame:
    """Mean success of one method: a line for every object, a column for every training seed."""
    table = plans.pivot_table(index="id", columns="training_seed", values="success")
    assert not table.isna().any(axis=None)  # every object was tried with every seed
    return table
