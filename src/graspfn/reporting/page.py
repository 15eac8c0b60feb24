"""The report as one self-contained HTML page."""

from __future__ import annotations

import base64
import importlib.metadata
import platform
from collections.abc import Sequence
from dataclasses import dataclass

import jinja2
import pandas as pd
from markupsafe import Markup

from graspfn.evaluation.statistics import Difference, Proportion, proportion
from graspfn.meshes.placed import RESTING
from graspfn.reporting import layout
from graspfn.reporting.figures import best_network
from graspfn.reporting.figures_results import OUTCOMES
from graspfn.reporting.inputs import ReportInputs
from graspfn.reporting.metrics import TABLE_1_PAIR, TABLE_2_PAIR, final_loss, networks_of, robust_gain
from graspfn.reporting.provenance import kinds_of_rejects, provenance
from graspfn.reporting.tables import who_recorded

PACKAGES = (
    "dartpy",
    "torch",
    "numpy",
    "scipy",
    "pandas",
    "trimesh",
    "embreex",
    "manifold3d",
    "matplotlib",
    "distributed",
    "mcap",
    "mcap-ros2-support",
    "safetensors",
    "dvc",
)
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


def rate(p: Proportion) -> str:
    return f"{p.value:.3f} [{p.low:.2f}, {p.high:.2f}]"


def gain(d: Difference) -> str:
    return f"{d.value:+.3f} [{d.low:+.2f}, {d.high:+.2f}]".replace("-", "−")


def seconds(value: float) -> str:
    """A duration, a dash for NaN."""
    if value != value:
        return DASH
    if value < 90:
        return f"{value:.1f} s"
    return f"{value / 60:.1f} min" if value < 5400 else f"{value / 3600:.1f} h"


def headlines(inputs: ReportInputs, table1: pd.DataFrame) -> list[tuple[str, str, str]]:
    """(number, what it is, its particulars), for the network with the best Robust Best Grasp."""
    network = best_network(table1)
    trials, robot = inputs.trials, inputs.robot_trials
    robust = trials[(trials["method"] == "Robust Best Grasp") & (trials["network"] == network)]
    p = proportion(robust["success"].to_numpy(), robust["id"].to_numpy())
    d = robust_gain(trials, network, "id", TABLE_1_PAIR)
    assert d is not None  # the simulation tries every method on every object
    robot_robust = robot[(robot["method"] == "Robust Best Grasp") & (robot["network"] == network)]
    number, interval = gain(d).split(" ", 1)
    found = [
        (f"{p.value:.3f}", "Robust Best Grasp, mean of Table 1", f"{network}; 95% {rate(p)[6:]}, {p.trials:,} trials"),
        (number, "Robust less Best Grasp, Table 1", f"{network}; 95% {interval}, {d.pairs:,} pairs"),
    ]
    if len(robot_robust):
        r = proportion(robot_robust["success"].to_numpy(), robot_robust["object"].to_numpy())
        who = "simulated robot" if robot_robust["simulated"].any() else "robot"
        found.append(
            (f"{r.value:.3f}", f"Robust Best Grasp, {who}", f"{network}; 95% {rate(r)[6:]}, {r.trials} trials")
        )
    return found


def gains(inputs: ReportInputs) -> list[tuple[str, str, str, int]]:
    """(table, network, robust less best, pairs)."""
    rows = []
    for name, trials, objects, pair_by in (
        ("Table 1", inputs.trials, "id", TABLE_1_PAIR),
        ("Table 2", inputs.robot_trials, "object", TABLE_2_PAIR),
    ):
        for network in networks_of(trials):
            if d := robust_gain(trials, network, objects, pair_by):
                rows.append((name, network, gain(d), d.pairs))
    return rows


def counts(inputs: ReportInputs) -> list[tuple[str, str]]:
    """(what, how many), from objects at rest to attempts by outcome."""
    rows = []
    for split, placed in inputs.placed.items():
        status = placed["status"]
        rows.append((f"{split} objects that came to rest", f"{int((status == RESTING).sum()):,}"))
        for reason, count in status[status != RESTING].value_counts().sort_index().items():
            rows.append((f"{split} objects left out: {reason}", f"{count:,}"))
    account = inputs.account
    labelled = account["status"] == "labelled"
    rows.append(("objects labelled", f"{int(labelled.sum()):,}"))
    for reason, count in account.loc[~labelled, "status"].value_counts().sort_index().items():
        rows.append((f"objects not labelled: {reason}", f"{count:,}"))
    sure = int((account["best"] == inputs.params.label.attempts).sum())
    rows.append(("training objects with a pose at which every attempt holds", f"{sure}"))
    rows.append(("attempts that provably touch nothing, not simulated", f"{int(account['untouched'].sum()):,}"))
    rows += [(f"attempts {meaning}", f"{int(account[name].sum()):,}") for name, meaning in OUTCOMES.items()]
    rows.append(("trials behind Table 1", f"{len(inputs.trials):,}"))
    rows.append(("recordings behind Table 2", f"{len(inputs.robot_trials):,}"))
    rows += [(f"final training loss, {network}", f"{final_loss(h):.4f}") for network, h in inputs.training.items()]
    return rows


def durations(inputs: ReportInputs) -> list[tuple[str, str]]:
    """(stage, how long) in the order of the workflow."""
    stages = ["select_meshes", "place_objects", "label_grasps", "render_images", "augment"]
    for name in ("pretrain", "train", "predict"):
        stages += [f"{name}@{network}" for network in inputs.params.networks]
    stages += ["evaluate", "record_robot", "analyse_robot"]
    return [(stage, seconds(float(inputs.stage_seconds.get(stage, "nan")))) for stage in stages]


def uncertainty(inputs: ReportInputs) -> list[tuple[str, str, str]]:
    """(condition, sigma_uv, sigma_theta), as estimated from the recordings."""

    def estimate(row: pd.Series, key: str) -> str:
        return f"{row[key]:.1f} [{row[f'{key}_low']:.1f}, {row[f'{key}_high']:.1f}]"

    return [
        (
            f"{row['sigma_uv_mm']:g} mm, {row['sigma_theta_deg']:g}°",
            estimate(row, "estimated_uv_mm"),
            estimate(row, "estimated_theta_deg"),
        )
        for _, row in inputs.robot_uncertainty.iterrows()
    ]


def versions() -> list[tuple[str, str]]:
    """(package, version) of what results depend on."""
    found = [("Python", platform.python_version())]
    for package in PACKAGES:
        try:
            found.append((package, importlib.metadata.version(package)))
        except importlib.metadata.PackageNotFoundError:
            found.append((package, DASH))
    return found


def render_page(
    inputs: ReportInputs, table1: pd.DataFrame, layouts: Sequence[layout.Layout], pictures: Sequence[Picture]
) -> str:
    """index.html; layouts: Tables 1 and 2."""
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
        headlines=headlines(inputs, table1),
        tables=[{"html": Markup(layout.to_html(table)), "caption": table.caption} for table in layouts],
        gains=gains(inputs),
        uncertainty=uncertainty(inputs),
        pictures=pictures,
        provenance=provenance(inputs.manifests, inputs.rejects),
        rejects=kinds_of_rejects(inputs.rejects),
        counts=counts(inputs),
        durations=durations(inputs),
        versions=versions(),
        parameters=inputs.parameters,
        recorded=who_recorded(inputs.robot_trials),
        objects=int((inputs.account["status"] == "labelled").sum()),
        tested=inputs.trials["id"].nunique(),
    )
