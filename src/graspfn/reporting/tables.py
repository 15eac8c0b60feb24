"""Tables 1 and 2 of the paper from tables of trials, and what stands under them."""

from __future__ import annotations

from typing import Any

import pandas as pd

from graspfn.evaluation.statistics import proportion
from graspfn.planning.methods import METHODS
from graspfn.reporting import paper

TABLE_1_COLUMNS = [
    "method",
    "network",
    "sigma_theta_deg",
    "sigma_uv_mm",
    "success",
    "ci_low",
    "ci_high",
    "trials",
    "no_grasp",
    "objects",
    "paper",
]
TABLE_2_COLUMNS = [
    "method",
    "sigma_uv_mm",
    "sigma_theta_deg",
    "success",
    "ci_low",
    "ci_high",
    "trials",
    "no_grasp",
    "objects",
    "paper",
    "simulated",
]
_KEY = ["method", "network", "sigma_theta_deg", "sigma_uv_mm"]


def full_name(method: str, network: str) -> str:
    """A method together with the network it plans with: "Best Grasp (fcn)"."""
    return f"{method} ({network})" if network else method


def _rates(trials: pd.DataFrame, objects: str) -> list[dict[str, Any]]:
    """One row per method, network and cell, in the paper's order; `objects` is the column that names them."""
    unknown = sorted(set(trials["method"]) - set(METHODS))
    if unknown:
        raise ValueError(f"trials: method {unknown[0]!r} is not one of {', '.join(METHODS)}")
    rows = []
    for key, group in trials.groupby(_KEY):
        rate = proportion(group["success"].to_numpy(), group[objects].to_numpy())
        rows.append(
            dict(zip(_KEY, key, strict=True))
            | {
                "success": rate.value,
                "ci_low": rate.low,
                "ci_high": rate.high,
                "trials": rate.trials,
                "no_grasp": int(group["u_m"].isna().sum()),
                "objects": rate.clusters,
            }
        )
    return sorted(rows, key=lambda row: (METHODS.index(row["method"]), *(row[name] for name in _KEY[1:])))


def table1(trials: pd.DataFrame) -> pd.DataFrame:
    """Success rate of every method, network and cell of simulated trials, beside the paper's (TABLE_1_COLUMNS).

    no_grasp: of the trials, those where the method found no pose to try.
    """
    rows = _rates(trials, "id")
    for row in rows:
        row["paper"] = paper.table_1(row["method"], row["sigma_uv_mm"], row["sigma_theta_deg"])
    return pd.DataFrame(rows, columns=TABLE_1_COLUMNS)


def table2(robot_trials: pd.DataFrame) -> pd.DataFrame:
    """Success rate of every method (with its network) in every condition of a robot (TABLE_2_COLUMNS)."""
    rows = _rates(robot_trials, "object")
    simulated = robot_trials.groupby(_KEY)["simulated"].any()
    for row in rows:
        row["simulated"] = bool(simulated[tuple(row[name] for name in _KEY)])
        row["paper"] = paper.table_2(row["method"], row["sigma_uv_mm"], row["sigma_theta_deg"])
        row["method"] = full_name(row["method"], row["network"])
    return pd.DataFrame(rows, columns=TABLE_2_COLUMNS)


def _span(numbers: pd.Series) -> str:
    low, high = int(numbers.min()), int(numbers.max())
    return f"{low}" if low == high else f"{low} to {high}"


def who_recorded(robot_trials: pd.DataFrame) -> str:
    """One plain sentence on whether a simulated or a real robot made the recordings."""
    count, simulated = len(robot_trials), int(robot_trials["simulated"].sum())
    if simulated == count:
        return f"All {count} recordings were made by a simulated robot: no real arm was involved."
    if simulated:
        return f"{simulated} of the {count} recordings were made by a simulated robot, the others by a real one."
    return f"All {count} recordings were made by a real robot."


def _without_a_grasp(table: pd.DataFrame) -> str:
    """How many trials failed because there was no pose to try; nothing where there was one in all."""
    count = int(table["no_grasp"].sum())
    if not count:
        return ""
    return f"In {count:,} of the {int(table['trials'].sum()):,} trials the method found no grasp, which is a failure. "


def caption1(table: pd.DataFrame, scale: str) -> str:
    """What Table 1 shows, with its counts and scale."""
    return (
        f"Table 1. Success rate in simulation under gripper pose uncertainty, scale “{scale}”: "
        f"{_span(table['trials'])} trials in each cell, on {_span(table['objects'])} test objects. "
        f"{_without_a_grasp(table)}"
        "Brackets: 95% intervals. Rows (paper): the figures printed by Johns, Leutenegger and Davison (2016), "
        "on 1000 objects of ModelNet and without intervals."
    )


def caption2(table: pd.DataFrame, robot_trials: pd.DataFrame, scale: str) -> str:
    """What Table 2 shows, with its counts and scale, and who made the recordings."""
    return (
        f"Table 2. Success rate on a robot, scale “{scale}”: {_span(table['trials'])} trials in each cell, on "
        f"{_span(table['objects'])} objects. {who_recorded(robot_trials)} {_without_a_grasp(table)}"
        "Brackets: 95% intervals with objects as clusters. Rows (paper): the figures printed by Johns, Leutenegger and "
        "Davison (2016), measured on a real Kinova MICO with 20 objects in five placements."
    )
