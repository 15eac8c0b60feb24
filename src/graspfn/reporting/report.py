"""The whole report: tables, figures, metrics and the page."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pandas as pd

from graspfn.reporting import layout, tables
from graspfn.reporting.figures import success
from graspfn.reporting.figures.registry import by_success, draw_all
from graspfn.reporting.figures.style import save_plate
from graspfn.reporting.inputs import ReportInputs
from graspfn.reporting.metrics import metrics
from graspfn.reporting.page import Picture, render_page
from graspfn.reporting.robustness import caption_robustness, layout_robustness, robustness_table
from graspfn.reporting.run_record import run_record


def _to_csv(table: pd.DataFrame, path: Path) -> None:
    table.to_csv(path, index=False, float_format="%.6g", lineterminator="\n")


def write_tables(
    inputs: ReportInputs, tables1: tables.Tables1, robustness: pd.DataFrame, folder: Path
) -> list[layout.Layout]:
    """table{1,2} as .csv, .md and .tex; robustness as .csv and .md; and what `dvc plots` draws of Table 1.

    Returns the layouts of Table 1's means, its differences, its means by source, Table 1, Table 2 and robustness.
    """
    scale, table2 = inputs.params.scale, tables.table2(inputs.robot_trials)
    means = layout.layout_means(tables1.means, tables.caption_means(tables1.means))
    laid_out = {
        "table1": layout.layout1(tables1.cells, tables.caption1(tables1.cells, scale)),
        "table2": layout.layout2(table2, tables.caption2(table2, inputs.robot_trials, scale)),
    }
    folder.mkdir(parents=True, exist_ok=True)
    for table, (name, shown) in zip((tables1.cells, table2), laid_out.items(), strict=True):
        _to_csv(table, folder / f"{name}.csv")
        (folder / f"{name}.md").write_text(layout.to_markdown(shown), encoding="utf-8")
        (folder / f"{name}.tex").write_text(layout.to_tex(shown, f"tab:{name}"), encoding="utf-8")
    _to_csv(success.series(tables1.cells, by_success(tables1.cells)[0]), folder / "success_vs_sigma_uv.csv")
    _to_csv(robustness, folder / "robustness.csv")
    caption = caption_robustness(robustness, inputs.params.disturb, scale)
    third = layout_robustness(robustness, caption)
    (folder / "robustness.md").write_text(layout.to_markdown(third), encoding="utf-8")
    caption = tables.caption_differences(tables1.differences)
    gains = layout.layout_differences(tables1.differences, tables.block_names(tables1.cells), caption)
    sources = sources_of(tables1.sources, inputs)
    with (folder / "table1.md").open("a", encoding="utf-8") as file:
        file.writelines("\n" + layout.to_markdown(shown) for shown in (means, gains, *sources))
    return [means, *sources, laid_out["table1"], gains, laid_out["table2"], third]


def sources_of(sources: pd.DataFrame, inputs: ReportInputs) -> list[layout.Layout]:
    """Table 1's means for each source of test objects; nothing where all have the same."""
    if sources["source"].nunique() < 2:
        return []
    learned_from = set(inputs.manifests["train"]["source"])
    return [layout.layout_sources(sources, tables.caption_sources(sources, learned_from))]


def write_failed(inputs: ReportInputs, folder: Path) -> list[Picture]:
    """Pages of a few failed trials; data/robot_failures has them all."""
    count = int((~inputs.robot_trials["success"].astype(bool)).sum())
    folder.mkdir(parents=True, exist_ok=True)
    pictures = []
    for i, failed in enumerate(inputs.failures):
        caption = (
            f"Why a trial failed: {failed.file}, as its recording tells. One of {len(inputs.failures)} of different "
            f"objects, the first; data/robot_failures has a page for each of the {count:,} trials of Table 2 that "
            f"failed. {tables.who_recorded(inputs.robot_trials)}"
        )
        pictures.append(Picture(f"failed_trial_{i + 1}", caption, failed.png))
        (folder / f"{pictures[-1].name}.png").write_bytes(failed.png)
    return pictures


def write_report(inputs: ReportInputs, folder: Path) -> None:
    """Write tables, figures/*.{png,pdf}, metrics.json, provenance.json and index.html into `folder`.

    Equal inputs give equal bytes, but for provenance.json and the page, which tell of the machine and its hours.
    Figures of an earlier report are removed.
    """
    tables1 = tables.Tables1.of(inputs.plans, inputs.graspable, inputs.test_source)
    robustness = robustness_table(inputs.disturbed)
    layouts = write_tables(inputs, tables1, robustness, folder)
    shutil.rmtree(folder / "figures", ignore_errors=True)
    plates = draw_all(inputs, tables1.cells, robustness)
    pictures = [Picture(plate.name, plate.caption, save_plate(plate, folder / "figures")) for plate in plates]
    pictures += write_failed(inputs, folder / "figures")
    numbers = metrics(inputs, tables1)
    (folder / "metrics.json").write_text(json.dumps(numbers, indent=2) + "\n")
    record = run_record(inputs.params, inputs.stage_seconds)
    (folder / "provenance.json").write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
    (folder / "index.html").write_text(render_page(inputs, numbers, layouts, pictures), encoding="utf-8")
