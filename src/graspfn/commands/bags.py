"""`graspfn logs`: a lab's own Table 2 and Sigma from its bags alone, without the workflow (paper VII-B)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from graspfn.params import Params
from graspfn.reporting import tables
from graspfn.reporting.failures import write_failures
from graspfn.reporting.layout import layout2, to_markdown
from graspfn.robot.analyse import Analysis, analyse
from graspfn.robot.bag import is_bag
from graspfn.robot.covariance_file import content, file_name, write_covariance
from graspfn.robot.described import read_table, read_tables
from graspfn.robot.read import recordings
from graspfn.robot.replan import Replanner
from graspfn.robot.trial import RecordingError
from graspfn.workflow.files import atomic


@dataclass(frozen=True)
class Bags:
    """rows: what trials.csv says of which. folder: that holds all of them, in which they are named."""

    paths: tuple[Path, ...]
    rows: dict[Path, dict[str, str]]
    folder: Path

    def analysed(self, params: Params, again: Replanner | None) -> Analysis:
        """RecordingError where none can be used."""
        found = analyse(self.paths, params.topics, params.arm, self.rows, self.folder, again, params.compute)
        found.check(1.0)
        return found

    def explained(self, out: Path, found: Analysis, params: Params, again: Replanner | None) -> int:
        """A page for each failed trial; how many."""
        opening_mm, compute = params.gripper.opening_mm, params.compute
        return write_failures(
            out, found.trials, self.folder, params.topics, params.arm, self.rows, opening_mm, again, compute
        )


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
    """Table 2, then Sigma of each condition, why trials failed, and what is odd about which trial."""
    measured = [measured.text() for measured in found.measured]
    return "\n".join([_table2(found), "", *measured, *filter(None, [found.reasons()]), *found.oddities()])


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
    folders = {}
    for text_ in networks:
        name, _, folder = text_.partition("=")
        if not name or not folder:
            raise RecordingError(f"--network {text_}: takes NAME=FOLDER, as recordings name it and where it is saved")
        folders[name] = Path(folder)
    again = Replanner.of(folders, params.plan, params.seed, params.camera, params.table, params.gripper)
    again.check()
    return again


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
