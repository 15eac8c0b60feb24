"""metrics.json: the numbers that `dvc metrics diff` compares."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from graspfn.evaluation.statistics import Difference, paired_difference
from graspfn.reporting.figures_results import OUTCOMES

HEADLINE_CELLS = ((5.0, 10.0), (20.0, 10.0))  # sigma_uv [mm], sigma_theta [deg]
BASE, ROBUST = "Best Grasp", "Robust Best Grasp"


def slug(method: str) -> str:
    return method.lower().replace(" ", "_")


def cell_name(sigma_uv_mm: float, sigma_theta_deg: float) -> str:
    """A key without dots, which dvc would read as levels: uv6_2_theta4_7."""
    return f"uv{sigma_uv_mm:g}_theta{sigma_theta_deg:g}".replace(".", "_")


def robust_gain(trials: pd.DataFrame, network: str, objects: str, pair_by: list[str]) -> Difference | None:
    """Robust Best Grasp less Best Grasp of one network, on the same trials; `pair_by`: what makes them so.

    None where they have no trial in common.
    """
    own = trials[trials["network"] == network].set_index("method")
    if not {BASE, ROBUST} <= set(own.index):
        return None
    robust, best = (own.loc[[name]].set_index(pair_by)["success"].sort_index() for name in (ROBUST, BASE))
    both = robust.index.intersection(best.index)
    if both.empty:
        return None
    clusters = both.get_level_values(objects).to_numpy()
    return paired_difference(robust.loc[both].to_numpy(), best.loc[both].to_numpy(), clusters)


TABLE_1_PAIR = ["id", "sigma_uv_mm", "sigma_theta_deg"]
TABLE_2_PAIR = ["object", "placement", "sigma_uv_mm", "sigma_theta_deg"]


def networks_of(trials: pd.DataFrame) -> list[str]:
    return sorted(set(trials["network"]) - {""})


def _difference(gain: Difference) -> dict[str, float]:
    return {"value": gain.value, "ci_low": gain.low, "ci_high": gain.high, "pairs": gain.pairs}


def _table(trials: pd.DataFrame, objects: str, pair_by: list[str], cells: list[tuple[float, float]]) -> dict[str, Any]:
    """For every network: mean success of each method over all trials and in some cells, and the robust method's gain.

    Centroid, which needs no network, stands under its own name.
    """
    result: dict[str, Any] = {}
    for network in ["", *networks_of(trials)]:
        own = trials[trials["network"] == network]
        entry: dict[str, Any] = {}
        for method, group in own.groupby("method"):
            numbers: dict[str, float] = {"mean_success": float(group["success"].mean())}
            for uv, theta in cells:
                here = group[(group["sigma_uv_mm"] == uv) & (group["sigma_theta_deg"] == theta)]
                if len(here):
                    numbers[f"success_{cell_name(uv, theta)}"] = float(here["success"].mean())
            entry[slug(str(method))] = numbers
        if gain := robust_gain(trials, network, objects, pair_by):
            entry["robust_minus_best"] = _difference(gain)
        result |= {network: entry} if network else entry
    return result


def _labels(account: pd.DataFrame, label_attempts: int) -> dict[str, float]:
    done = account[list(OUTCOMES)].sum()
    near, culled = int(done.sum()), int(account["untouched"].sum())
    return {
        "objects": int((account["status"] == "labelled").sum()),
        "attempts_per_pose": label_attempts,
        "attempts": near + culled,
        "held_share_of_all": float(done["held"] / max(near + culled, 1)),
        "held_share_of_touching": float(done["held"] / max(near, 1)),
        "objects_with_a_pose_that_always_holds": int((account["best"] == label_attempts).sum()),
        "diverged": int(done["diverged"]),
    }


def final_loss(history: pd.DataFrame) -> float:
    """Mean loss of the last twentieth of the steps; NaN without steps."""
    return float(history["loss"].tail(max(1, len(history) // 20)).mean()) if len(history) else float("nan")


def rounded(value: Any) -> Any:
    """Numbers to 4 digits; NaN, which JSON does not have, to null."""
    if isinstance(value, Mapping):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, float):
        return None if np.isnan(value) else round(value, 4)
    return value


def metrics(
    trials: pd.DataFrame,
    robot_trials: pd.DataFrame,
    account: pd.DataFrame,
    label_attempts: int,
    training: Mapping[str, pd.DataFrame],
) -> dict[str, Any]:
    """Nested numbers: table1.<network>.<method>.mean_success, ..., labels, training."""
    conditions = sorted(set(zip(robot_trials["sigma_uv_mm"], robot_trials["sigma_theta_deg"], strict=True)))
    return rounded(
        {
            "table1": _table(trials, "id", TABLE_1_PAIR, list(HEADLINE_CELLS)),
            "table2": _table(robot_trials, "object", TABLE_2_PAIR, conditions)
            | {"simulated_recordings": int(robot_trials["simulated"].sum()), "recordings": len(robot_trials)},
            "labels": _labels(account, label_attempts),
            "training": {network: {"final_loss": final_loss(history)} for network, history in training.items()},
        }
    )
