"""A page for every failed trial: why it failed, as far as its recording tells (paper VII-B)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from graspfn.params import Arm, Compute, Topics
from graspfn.planning.methods import ROBUST
from graspfn.reporting.figures.failed_trial import draw_failed_trial
from graspfn.reporting.figures.style import png_bytes
from graspfn.robot.analyse import each_bag
from graspfn.robot.places import camera_of
from graspfn.robot.read import read_trial
from graspfn.robot.replan import Replanned, Replanner
from graspfn.robot.trial import TrialRecording
from graspfn.workflow.files import atomic


def page_path(folder: Path, file: str) -> Path:
    """Where the page of a bag lies."""
    return folder / f"{file}.png"


def write_failures(
    out: Path,
    trials: pd.DataFrame,
    folder: Path,
    topics: Topics,
    arm: Arm,
    table: Mapping[Path, Mapping[str, str]],
    opening_mm: float,
    again: Replanner | None,
    compute: Compute | None,
) -> int:
    """The page of every trial of an analysis that failed, as out/<bag>.png; how many.

    folder: of the bags; table: what trials.csv says of them. again: whose functions stand on the pages.
    """
    failed = trials[~trials["success"].astype(bool)].to_dict("records")
    tasks = []
    for row in failed:
        file, bag = str(row["file"]), folder / str(row["file"])
        remarks = [str(row[key]) for key in ("flags", "doubts", "replanned") if row[key]]
        tasks.append((file, (bag, file, topics, arm, table.get(bag), opening_mm, again, remarks)))
    for file, page in each_bag(page_of, tasks, compute):
        if isinstance(page, Exception):
            raise page
        with atomic(page_path(out, file)) as part:
            part.write_bytes(page)
    return len(failed)


def page_of(
    bag: Path,
    name: str,
    topics: Topics,
    arm: Arm,
    row: Mapping[str, str] | None,
    opening_mm: float,
    again: Replanner | None,
    remarks: Sequence[str],
) -> bytes:
    """The PNG."""
    trial = read_trial(bag, topics, arm, row, detail=True)
    figure = draw_failed_trial(name, trial, arm, opening_mm, camera_of(trial), _planned(trial, again), remarks)
    return png_bytes(figure, palette=True)


def _planned(trial: TrialRecording, again: Replanner | None) -> Replanned | None:
    try:
        return again.replan(trial) if again else None
    except ValueError:  # which the remarks say
        return None


def some(trials: pd.DataFrame, count: int) -> list[str]:
    """Names of so many failed trials of different objects, those of Robust Best Grasp with the least Sigma first."""
    failed = trials[~trials["success"].astype(bool)]
    order = failed.assign(other=failed["method"] != ROBUST)
    order = order.sort_values(["other", "sigma_uv_mm", "sigma_theta_deg", "object", "placement", "network", "file"])
    return [str(file) for file in order.drop_duplicates("object")["file"].head(count)]
