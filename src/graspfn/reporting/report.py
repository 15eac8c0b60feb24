"""The whole report: tables, figures, metrics and the page."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from graspfn.reporting import layout, tables
from graspfn.reporting.figures import draw_all
from graspfn.reporting.inputs import ReportInputs
from graspfn.reporting.metrics import metrics
from graspfn.reporting.page import Picture, render_page
from graspfn.reporting.style import save_plate


def write_tables(inputs: ReportInputs, folder: Path) -> list[layout.Layout]:
    """table1 and table2 as .csv, .md and .tex; returns their layouts."""
    scale = inputs.params.scale
    table1, table2 = tables.table1(inputs.trials), tables.table2(inputs.robot_trials)
    layouts = [
        layout.layout1(table1, tables.caption1(table1, scale)),
        layout.layout2(table2, tables.caption2(table2, inputs.robot_trials, scale)),
    ]
    folder.mkdir(parents=True, exist_ok=True)
    for name, table, laid_out in zip(("table1", "table2"), (table1, table2), layouts, strict=True):
        table.to_csv(folder / f"{name}.csv", index=False, float_format="%.6g", lineterminator="\n")
        (folder / f"{name}.md").write_text(layout.to_markdown(laid_out), encoding="utf-8")
        (folder / f"{name}.tex").write_text(layout.to_tex(laid_out, f"tab:{name}"), encoding="utf-8")
    return layouts


def write_report(inputs: ReportInputs, folder: Path) -> None:
    """Write table{1,2}.{csv,md,tex}, figures/*.{png,pdf}, metrics.json and index.html into `folder`.

    Equal inputs give equal bytes. Figures of an earlier report are removed.
    """
    layouts = write_tables(inputs, folder)
    shutil.rmtree(folder / "figures", ignore_errors=True)
    table1 = tables.table1(inputs.trials)
    pictures = [
        Picture(plate.name, plate.caption, save_plate(plate, folder / "figures")) for plate in draw_all(inputs, table1)
    ]
    numbers = metrics(inputs.trials, inputs.robot_trials, inputs.account, inputs.params.label.attempts, inputs.training)
    (folder / "metrics.json").write_text(json.dumps(numbers, indent=2) + "\n")
    (folder / "index.html").write_text(render_page(inputs, table1, layouts, pictures), encoding="utf-8")
