"""`graspfn logs`: a lab's own Table 2 and Sigma from its bags alone, without the workflow (paper VII-B)."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from graspfn.evaluation.planner import Planner
from graspfn.imaging.camera import Camera
from graspfn.learning.folder import input_kind
from graspfn.learning.weights import load_network
from graspfn.params import Arm, Params, Topics
from graspfn.reporting import tables
from graspfn.reporting.figures.failed_trial import draw_failed_trial
from graspfn.reporting.figures.style import png_bytes
from graspfn.reporting.layout import layout2, to_markdown
from graspfn.robot.analyse import Analysis, analyse
from graspfn.robot.bag import is_bag
from graspfn.robot.covariance_file import content, file_name, write_covariance
from graspfn.robot.described import read_table, read_tables
from graspfn.robot.read import read_trial, recordings
from graspfn.robot.replan import Replanner
from graspfn.robot.trial import RecordingError, TrialRecording
from graspfn.workflow.files import atomic


@dataclass(frozen=True)
class Bags:
    """rows: what trials.csv says of which. folder: that holds all of them, in which they are named."""

    paths: tuple[Path, ...]
    rows: dict[Path, dict[str, str]]
    folder: Path

    def analysed(self, topics: Topics, arm: Arm) -> Analysis:
        """RecordingError where none can be used."""
        found = analyse(self.paths, topics, arm, self.rows, self.folder)
        found.check(1.0)
        return found


def gather(paths: Sequence[Path]) -> Bags:
    """All bags in folders, and bags by themselves; RecordingError for a path that is not."""
    bags: dict[Path, None] = {}
    rows: dict[Path, dict[str, str]] = {}
    for path in paths:
        if not path.exists() and not path.is_symlink():
            raise RecordingError(f"{path}: no such file or folder")
        if path.is_dir() and not is_bag(path):
            there = recordings(path)
            bags |= dict.fromkeys(there)
            rows |= read_tables(path, there)
        else:
            bags[path] = None
            rows |= {bag: row for bag, row in read_table(path.parent).items() if bag == path}
    mixed = len({bag.is_absolute() for bag in bags}) > 1
    parents = [bag.parent.absolute() if mixed else bag.parent for bag in bags]
    folder = Path(os.path.commonpath([str(parent) for parent in parents]))
    if mixed:
        bags = {bag.absolute(): None for bag in bags}
        rows = {bag.absolute(): row for bag, row in rows.items()}
    return Bags(tuple(bags), rows, folder)


def text(found: Analysis) -> str:
    """Table 2, then Sigma of each condition, and what is odd about which trial."""
    return "\n".join([_table2(found), "", *(measured.text() for measured in found.measured), *found.oddities()])


def _table2(found: Analysis) -> str:
    table = tables.table2(found.trials)
    return to_markdown(layout2(table, tables.caption2(table, found.trials, "logs")))


def as_dict(found: Analysis) -> dict[str, Any]:
    """All that was found, as JSON has it: no NaN."""

    def records(table: pd.DataFrame) -> list[dict[str, Any]]:
        return [{str(key): _plain(value) for key, value in row.items()} for row in table.to_dict("records")]

    return {
        "table2": records(tables.table2(found.trials)),
        "uncertainty": [content(measured) for measured in found.measured],
        "trials": records(found.trials),
        "unused": records(found.unused),
    }


def _plain(value: Any) -> Any:
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not np.isfinite(value) else value


def replanner(params: Params, networks: Sequence[str]) -> Replanner:
    """networks: NAME=FOLDER, the name that recordings give a network, and where it is saved."""
    loaded = {}
    for text_ in networks:
        name, _, folder = text_.partition("=")
        if not name or not folder:
            raise RecordingError(f"--network {text_}: takes NAME=FOLDER, as recordings name it and where it is saved")
        loaded[name] = input_kind(Path(folder)), load_network(Path(folder))
    planner, camera = Planner(params.plan, params.seed), Camera.from_params(params.camera)
    return Replanner(loaded, planner, camera, params.table, params.gripper)


def replan(found: Analysis, bags: Bags, params: Params, again: Replanner) -> dict[str, str]:
    """A line for every trial, by file, whose recorded image gives another pose than was recorded, or none can be
    planned on."""
    lines = {}
    for file in found.trials["file"]:
        trial = _read(bags, file, params)
        try:
            planned = again.replan(trial)
        except ValueError as error:  # of an image that shows no table, say
            lines[file] = f"cannot be planned again: {error}"
            continue
        if planned and (line := planned.differs(trial.commanded)):
            lines[file] = line
    return lines


def _read(bags: Bags, file: str, params: Params, detail: bool = False) -> TrialRecording:
    path = bags.folder / file
    return read_trial(path, params.topics, params.arm, bags.rows.get(path), detail)


def write_failures(
    out: Path, found: Analysis, bags: Bags, params: Params, again: Replanner | None, differs: Mapping[str, str]
) -> int:
    """A page for every failed trial, failures/<bag>.png; how many."""
    failed = found.trials[~found.trials["success"].astype(bool)]
    for row in failed.to_dict("records"):
        file = str(row["file"])
        trial = _read(bags, file, params, detail=True)
        try:
            planned = again.replan(trial) if again else None
        except ValueError:
            planned = None
        height, width = trial.depth.shape
        camera = Camera.of_the_paper(width, height, float(trial.camera_matrix[0, 0]))
        remarks = "; ".join(filter(None, [str(row["flags"]), str(row["doubts"]), differs.get(file, "")]))
        fingers = params.arm.finger_joints or ()
        page = draw_failed_trial(file, trial, fingers, params.gripper.opening_mm, camera, planned, remarks)
        with atomic(out / "failures" / f"{file.replace('/', '-')}.png") as part:
            part.write_bytes(png_bytes(page))
    return len(failed)


def write(out: Path, found: Analysis) -> None:
    """table2.md, table2.csv, trials.csv, unused.csv, and Sigma of each condition in covariance/."""
    texts = {
        "table2.md": _table2(found),
        "table2.csv": tables.table2(found.trials).to_csv(index=False),
        "trials.csv": found.trials.to_csv(index=False),
        "unused.csv": found.unused.to_csv(index=False),
    }
    for name, content_ in texts.items():
        with atomic(out / name) as part:
            part.write_text(content_, encoding="utf-8")
    for measured in found.measured:
        write_covariance(out / "covariance" / file_name(measured.label), measured)
