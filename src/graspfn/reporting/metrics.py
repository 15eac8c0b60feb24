"""metrics.json: the numbers that `dvc metrics diff` compares."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import pandas as pd

from graspfn.evaluation.statistics import Difference, paired_difference
from graspfn.planning.methods import BEST, ROBUST
from graspfn.reporting.differences import TRIALS
from graspfn.reporting.expectation import check_expected
from graspfn.reporting.figures.label_outcomes import OUTCOMES
from graspfn.reporting.inputs import ReportInputs
from graspfn.reporting.plans import blocks, of_cell, of_method
from graspfn.reporting.sizes import size_statistics, sizes
from graspfn.reporting.tables import Tables1

HEADLINE_CELLS = ((5.0, 10.0), (20.0, 10.0))  # sigma_uv [mm], sigma_theta [deg]


def slug(method: str) -> str:
    """A key: best_grasp_likeliest_class."""
    return "".join(c for c in method.lower().replace(" ", "_") if c.isalnum() or c in "_-")


def cell_name(sigma_uv_mm: float, sigma_theta_deg: float) -> str:
    """A key without dots, which dvc would read as levels: uv6_2_theta4_7."""
    return f"uv{sigma_uv_mm:g}_theta{sigma_theta_deg:g}".replace(".", "_")


def robust_gain(trials: pd.DataFrame, network: str, objects: str, pair_by: list[str]) -> Difference | None:
    """Robust Best Grasp less Best Grasp of one network, on the same trials; `pair_by`: what makes them so.

    None where they have no trial in common.
    """
    own = trials[trials["network"] == network].set_index("method")
    if not {BEST, ROBUST} <= set(own.index):
        return None
    robust, best = (own.loc[[name]].set_index(pair_by)["success"].sort_index() for name in (ROBUST, BEST))
    both = robust.index.intersection(best.index)
    if both.empty:
        return None
    clusters = both.get_level_values(objects).to_numpy()
    return paired_difference(robust.loc[both].to_numpy(), best.loc[both].to_numpy(), clusters)


TABLE_2_PAIR = ["object", "placement", "sigma_uv_mm", "sigma_theta_deg"]


def networks_of(trials: pd.DataFrame) -> list[str]:
    return sorted(set(trials["network"]) - {""})


def _difference(gain: Difference) -> dict[str, float]:
    return {"value": gain.value, "ci_low": gain.low, "ci_high": gain.high, "pairs": gain.pairs}


def _compared(line: Mapping[Any, Any]) -> dict[str, Any]:
    """Of a line of `differences`."""
    return {key: line[key] for key in ("value", "ci_low", "ci_high", "objects")}


def _differences(lines: pd.DataFrame) -> dict[str, Any]:
    """Of one network in one block; lines: of `differences`."""
    result: dict[str, Any] = {}
    for (name, by), group in lines.groupby(["comparison", "by"]):
        of_cells = group["sigma_uv_mm"].notna()
        (pooled,) = group[~of_cells].to_dict("records")
        cells = group[of_cells].to_dict("records")
        found = _compared(pooled) | {
            "cells": {cell_name(line["sigma_uv_mm"], line["sigma_theta_deg"]): _compared(line) for line in cells}
        }
        entry = result.setdefault(str(name), {})
        entry |= found if by == TRIALS else {str(by): found}
    return result


def _method(mean: pd.Series, rows: pd.DataFrame) -> dict[str, Any]:
    """One method: its means over cells, and success in the HEADLINE_CELLS; rows: its cells of Table 1."""
    numbers: dict[str, Any] = {"mean_success": float(mean["success"])}
    numbers |= {key: float(mean[key]) for key in ("ci_low", "ci_high", "expected", "promise", "paper")}
    numbers |= {key: int(mean[key]) for key in ("trials", "objects", "networks", "no_grasp")}
    for uv, theta in HEADLINE_CELLS:
        for line in of_cell(rows, uv, theta).itertuples():
            name = cell_name(uv, theta)
            numbers[f"success_{name}"] = {"value": line.success, "ci_low": line.ci_low, "ci_high": line.ci_high}
    return numbers


def simulation_numbers(plans: pd.DataFrame, graspable: Collection[str], tables: Tables1) -> dict[str, Any]:
    """For each block of objects and each network in it, its methods, and differences between them.

    Centroid, which needs no network, stands under its own name, the true function under true_function.
    """
    cells, means = tables.cells, tables.means
    result: dict[str, Any] = {}
    for block, of_block in blocks(plans, graspable).items():
        entry: dict[str, Any] = {"objects": of_block["id"].nunique()}
        for _, mean in means[means["objects_of"] == block].iterrows():
            method, network = mean["method"], mean["network"]
            rows = of_method(cells[cells["objects_of"] == block], method, network)
            where = entry.setdefault(slug(network), {}) if network else entry
            where[slug(method)] = _method(mean, rows)
        own = tables.differences[tables.differences["objects_of"] == block]
        for network, lines in own.groupby("network"):
            entry[slug(str(network))] |= _differences(lines)
        result[block] = entry
    return result


def source_numbers(sources: pd.DataFrame) -> dict[str, Any]:
    """For each source of test objects its number of them, and every method's mean success over all cells."""
    result: dict[str, Any] = {}
    for line in sources.to_dict("records"):
        entry = result.setdefault(line["source"], {"objects": line["objects"]})
        where = entry.setdefault(slug(line["network"]), {}) if line["network"] else entry
        where[slug(line["method"])] = {key: line[key] for key in ("success", "ci_low", "ci_high")}
    return result


def robot_numbers(trials: pd.DataFrame) -> dict[str, Any]:
    """For every network: mean success of each method over all and in each condition, and the robust one's gain."""
    cells = sorted(set(zip(trials["sigma_uv_mm"], trials["sigma_theta_deg"], strict=True)))
    result: dict[str, Any] = {}
    for network in ["", *networks_of(trials)]:
        own = trials[trials["network"] == network]
        entry: dict[str, Any] = {}
        for method, group in own.groupby("method"):
            numbers: dict[str, float] = {"mean_success": float(group["success"].mean())}
            for uv, theta in cells:
                here = of_cell(group, uv, theta)
                if len(here):
                    numbers[f"success_{cell_name(uv, theta)}"] = float(here["success"].mean())
            entry[slug(str(method))] = numbers
        if gain := robust_gain(trials, network, "object", TABLE_2_PAIR):
            entry["robust_minus_best"] = _difference(gain)
        result |= {network: entry} if network else entry
    return result


def label_numbers(account: pd.DataFrame, label_attempts: int) -> dict[str, float]:
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
    """Numbers to 4 digits; NaN and the infinite, which JSON does not have, to null."""
    if isinstance(value, Mapping):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, float):
        return round(value, 4) if np.isfinite(value) else None
    return value


def metrics(inputs: ReportInputs, tables: Tables1) -> dict[str, Any]:
    """Nested numbers: table1.<block>.<network>.<method>.mean_success, ..., table2, objects, labels, training."""
    attempts, robot = inputs.params.label.attempts, inputs.robot_trials
    objects = size_statistics(sizes(inputs.manifests, inputs.placed))
    objects["test"] |= {"tried": inputs.plans["id"].nunique(), "graspable": len(inputs.graspable)}
    return rounded(
        {
            "table1": simulation_numbers(inputs.plans, inputs.graspable, tables),
            "sources": source_numbers(tables.sources),
            "table2": robot_numbers(robot)
            | {"simulated_recordings": int(robot["simulated"].sum()), "recordings": len(robot)},
            "expected": dataclasses.asdict(check_expected(inputs.plans)),
            "objects": objects,
            "labels": label_numbers(inputs.account, attempts),
            "test_labels": label_numbers(inputs.test_account, attempts),
            "training": {network: {"final_loss": final_loss(h)} for network, h in inputs.training.items()},
        }
    )
