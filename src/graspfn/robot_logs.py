"""`graspfn logs`: a lab's own Table 2 and Sigma from its bags alone, without the workflow (paper VII-B)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from graspfn.params import Arm, Topics
from graspfn.reporting import tables
from graspfn.reporting.layout import layout2, to_markdown
from graspfn.robot.analyse import Analysis, analyse
from graspfn.robot.bag import is_bag
from graspfn.robot.covariance_file import content, file_name, write_covariance
from graspfn.robot.described import read_table
from graspfn.robot.read import recordings
from graspfn.robot.trial import RecordingError
from graspfn.workflow.files import atomic


def analyse_paths(paths: Sequence[Path], topics: Topics, arm: Arm) -> Analysis:
    """Of all bags in folders, and bags by themselves; RecordingError where none can be used."""
    bags: dict[Path, None] = {}
    rows: dict[Path, dict[str, str]] = {}
    for path in paths:
        if not path.exists() and not path.is_symlink():
            raise RecordingError(f"{path}: no such file or folder")
        if path.is_dir() and not is_bag(path):
            bags |= dict.fromkeys(recordings(path))
            rows |= read_table(path)
        else:
            bags[path] = None
            rows |= {bag: row for bag, row in read_table(path.parent).items() if bag == path}
    found = analyse(bags, topics, arm, rows)
    found.check(1.0)
    return found


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
