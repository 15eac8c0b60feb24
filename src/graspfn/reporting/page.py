"""The report as one self-contained HTML page."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jinja2
import numpy as np
import pandas as pd
from markupsafe import Markup

from graspfn.evaluation.planner import TRUE
from graspfn.evaluation.statistics import proportion
from graspfn.meshes.placed import RESTING
from graspfn.planning.methods import ROBUST
from graspfn.reporting import layout
from graspfn.reporting.figures.label_outcomes import OUTCOMES
from graspfn.reporting.inputs import ReportInputs
from graspfn.reporting.metrics import final_loss, slug
from graspfn.reporting.plans import ALL, GRASPABLE, block_to_show, graspable_objects
from graspfn.reporting.provenance import kinds_of_rejects, provenance
from graspfn.reporting.run_record import versions
from graspfn.reporting.sizes import reasons
from graspfn.reporting.summary import gain, interval, trained
from graspfn.reporting.tables import who_recorded

DASH = layout.BLANK


@dataclass(frozen=True)
class Picture:
    """A figure on the page: the same PNG as in figures/."""

    name: str
    caption: str
    png: bytes

    @property
    def source(self) -> str:
        return "data:image/png;base64," + base64.b64encode(self.png).decode()


def seconds(value: float) -> str:
    """A duration, a dash for NaN."""
    if value != value:
        return DASH
    if value < 90:
        return f"{value:.1f} s"
    return f"{value / 60:.1f} min" if value < 5400 else f"{value / 3600:.1f} h"


def headlines(inputs: ReportInputs, numbers: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """(number, what it is, its particulars), for the network with the best Robust Best Grasp; numbers: the metrics."""
    name = block_to_show(numbers["table1"])
    block = numbers["table1"][name]
    network, entry = next(iter(trained(block).items()))
    whom = f"{block['objects']:,} {'objects that can be held' if name == GRASPABLE else 'objects'}"
    robust, difference = entry["robust_best_grasp"], entry["robust_minus_best"]
    found = [
        (
            f"{robust['mean_success']:.3f}",
            "Robust Best Grasp, mean of Table 1",
            f"{network}; 95%{interval(robust)}; {whom}",
        ),
        (
            gain(difference).split()[0],
            "Robust less Best Grasp, Table 1",
            f"{network}; 95%{interval(difference)}; {whom}",
        ),
    ]
    if ceiling := block.get(slug(TRUE)):
        best = ceiling["robust_best_grasp"]
        found.append((f"{best['mean_success']:.3f}", "the ceiling, mean of Table 1", f"{TRUE}; 95%{interval(best)}"))
    robot = inputs.robot_trials
    own = robot[(robot["method"] == ROBUST) & (robot["network"] == network)]
    if len(own):
        r = proportion(own["success"].to_numpy(), own["object"].to_numpy())
        who = "simulated robot" if own["simulated"].any() else "robot"
        particulars = f"{network}; 95% [{r.low:.2f}, {r.high:.2f}]; {r.trials:,} trials"
        found.append((f"{r.value:.3f}", f"Robust Best Grasp, {who}", particulars))
    return found


DIFFERENCES = {
    "robust_minus_best": "Robust less Best",
    "robust_minus_likeliest": "Robust less likeliest class",
    "best_minus_centroid": "Best less Centroid",
    "robust_minus_centroid": "Robust less Centroid",
    "ceiling_minus_robust": "ceiling less Robust",
}
BLOCKS = {ALL: "all test objects", GRASPABLE: "those that can be held"}


def gains(numbers: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Headings, and a row for every network and difference: in each block of Table 1 and in Table 2, over all cells."""
    parts = {f"Table 1, {BLOCKS[block]}": entry for block, entry in numbers["table1"].items()}
    parts["Table 2"] = numbers["table2"]
    rows = []
    for network in [*trained(numbers["table1"][ALL]), slug(TRUE)]:
        whose = TRUE if network == slug(TRUE) else network
        for key, what in DIFFERENCES.items():
            found = [part.get(network, {}).get(key) for part in parts.values()]
            if any(found):
                rows.append([whose, what, *(gain(one) if one else DASH for one in found)])
    return ["Network", "Difference", *parts], rows


def counts(inputs: ReportInputs) -> list[tuple[str, str]]:
    """(what, how many), from objects at rest to attempts by outcome."""
    rows = []
    for split, placed in inputs.placed.items():
        status = placed["status"]
        rows.append((f"{split} objects that came to rest", f"{int((status == RESTING).sum()):,}"))
        rows += [(f"{split} objects left out: {reason}", f"{count:,}") for reason, count in reasons(status).items()]
        smaller = int(((status == RESTING) & (placed["fit_scale"] < 1)).sum())
        rows.append((f"{split} objects made smaller to fit the gripper", f"{smaller:,}"))
    account, attempts = inputs.account, inputs.params.label.attempts
    for split, labels in (("train", account), ("test", inputs.test_account)):
        labelled = labels["status"] == "labelled"
        rows.append((f"{split} objects labelled", f"{int(labelled.sum()):,}"))
        for reason, count in labels.loc[~labelled, "status"].value_counts().sort_index().items():
            rows.append((f"{split} objects not labelled: {reason}", f"{count:,}"))
        sure = len(graspable_objects(labels, attempts))
        rows.append((f"{split} objects with a pose at which every attempt holds", f"{sure:,}"))
    rows.append(
        ("training attempts that provably touch nothing, not simulated", f"{int(account['untouched'].sum()):,}")
    )
    rows += [(f"training attempts {meaning}", f"{int(account[name].sum()):,}") for name, meaning in OUTCOMES.items()]
    rows.append(("trials behind Table 1", f"{len(inputs.trials):,}"))
    rows.append(("recordings behind Table 2", f"{len(inputs.robot_trials):,}"))
    if len(inputs.robot_unused):
        rows.append(("recordings that could not be used", f"{len(inputs.robot_unused):,}"))
    if doubtful := int((inputs.robot_trials["doubts"] != "").sum()):
        rows.append(("recordings whose reached pose measures nothing, not in Σ", f"{doubtful:,}"))
    rows += [(f"final training loss, {network}", f"{final_loss(h):.4f}") for network, h in inputs.training.items()]
    return rows


def durations(inputs: ReportInputs) -> list[tuple[str, str]]:
    """(stage, how long) in the order of the workflow."""
    stages = ["select_meshes", "place_objects", *(f"label_grasps@{split}" for split in inputs.placed)]
    stages += ["render_images", "augment"]
    runs = [f"{network}-{seed}" for network in inputs.params.networks for seed in inputs.params.training_seeds]
    for name in ("pretrain", "train", "predict"):
        stages += [f"{name}@{run}" for run in runs]
    stages += ["evaluate", "disturb", "record_robot", "analyse_robot"]
    return [(stage, seconds(float(inputs.stage_seconds.get(stage, "nan")))) for stage in stages]


FOUND = {
    "estimated_u_mm": "σ<sub>u</sub>, mm",
    "estimated_v_mm": "σ<sub>v</sub>, mm",
    "estimated_theta_deg": "σ<sub>θ</sub>, °",
    "correlation_u_v": "ρ<sub>uv</sub>",
    "bias_u_mm": "bias u, mm",
    "bias_v_mm": "bias v, mm",
    "bias_theta_deg": "bias θ, °",
}


def uncertainty(inputs: ReportInputs) -> tuple[list[Markup], list[list[str]]]:
    """Headings, and a row for every condition: Sigma and bias as estimated from the recordings."""

    def estimate(row: pd.Series, key: str) -> str:
        if np.isnan(row[key]):  # one draw says nothing of its spread
            return DASH
        digits = 2 if key.startswith("correlation") else 1
        return f"{row[key]:.{digits}f} [{row[f'{key}_low']:.{digits}f}, {row[f'{key}_high']:.{digits}f}]"

    headings = ["Condition", *FOUND.values(), "Gaussian, p", "outliers", "draws"]
    rows = [
        [
            row["condition"],
            *(estimate(row, key) for key in FOUND),
            DASH if np.isnan(row["normality"]) else f"{row['normality']:.2g}",
            row["outliers"] or "none",
            f"{row['draws']}",
        ]
        for _, row in inputs.robot_uncertainty.iterrows()
    ]
    return [Markup(heading) for heading in headings], rows


def render_page(
    inputs: ReportInputs,
    numbers: Mapping[str, Any],
    layouts: Sequence[layout.Layout],
    pictures: Sequence[Picture],
) -> str:
    """index.html; numbers: the metrics; layouts: of the tables."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("graspfn", "reporting"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template("page.html.j2").render(
        scale=inputs.params.scale,
        seed=inputs.params.seed,
        networks=inputs.params.networks,
        headlines=headlines(inputs, numbers),
        tables=[{"html": Markup(layout.to_html(table)), "caption": table.caption} for table in layouts],
        gains=gains(numbers),
        uncertainty=uncertainty(inputs),
        pictures=pictures,
        provenance=provenance(inputs.manifests, inputs.rejects),
        rejects=kinds_of_rejects(inputs.rejects),
        counts=counts(inputs),
        durations=durations(inputs),
        versions=[(package, version or DASH) for package, version in versions()],
        parameters=inputs.parameters,
        recorded=who_recorded(inputs.robot_trials),
        objects=int((inputs.account["status"] == "labelled").sum()),
        tested=inputs.trials["id"].nunique(),
    )
