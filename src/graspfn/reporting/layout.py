"""A table laid out as the paper prints it, and that layout as Markdown, LaTeX and HTML."""

from __future__ import annotations

import html
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from graspfn.evaluation.planner import TRUE
from graspfn.reporting.differences import EXPECTED, SHARE, SHOWN, TRIALS, cells_of
from graspfn.reporting.tables import block_names, full_name, kind

BLANK = "–"
JUDGED = {TRIALS: "by trials", EXPECTED: "as expected"}


@dataclass(frozen=True)
class Cell:
    """A success rate; the interval is empty for the paper's figures, everything is where nothing was tried."""

    rate: str
    interval: str = ""


@dataclass(frozen=True)
class Row:
    """One method: `ours` tells our rows from the paper's, `first` starts another method."""

    name: str
    cells: tuple[Cell, ...]
    ours: bool
    first: bool


@dataclass(frozen=True)
class Block:
    """Rows under a heading of their own, "" for none."""

    heading: str
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class Layout:
    """Blocks of rows under grouped columns; groups are (label, labels of its columns)."""

    caption: str
    groups: tuple[tuple[str, tuple[str, ...]], ...]
    blocks: tuple[Block, ...]

    @property
    def columns(self) -> list[str]:
        return [column for _, columns in self.groups for column in columns]


def number(value: float, digits: int = 3) -> str:
    """A fixed number of digits, a dash for NaN."""
    return BLANK if math.isnan(value) else f"{value:.{digits}f}"


def _ours(line: pd.Series | None) -> Cell:
    if line is None:
        return Cell(BLANK)
    return Cell(number(line["success"]), f"[{number(line['ci_low'], 2)}, {number(line['ci_high'], 2)}]")


def _rows(table: pd.DataFrame, cells: list[tuple[float, float]]) -> tuple[Row, ...]:
    """Rows of a table with the columns name, method, sigma_uv_mm, sigma_theta_deg; cells are (uv, theta).

    method: the paper's, whose row comes after ours.
    """
    rows = []
    for method in dict.fromkeys(table["method"]):
        of_method = table[table["method"] == method]
        printed = {(line["sigma_uv_mm"], line["sigma_theta_deg"]): line["paper"] for _, line in of_method.iterrows()}
        for name in dict.fromkeys(of_method["name"]):
            found = {
                (line["sigma_uv_mm"], line["sigma_theta_deg"]): line
                for _, line in of_method[of_method["name"] == name].iterrows()
            }
            ours = tuple(_ours(found.get(cell)) for cell in cells)
            rows.append(Row(name, ours, ours=True, first=name == of_method["name"].iloc[0]))
        paper = tuple(Cell(number(printed.get(cell, math.nan))) for cell in cells)
        rows.append(Row(f"{method} (paper)", paper, ours=False, first=False))
    return tuple(rows)


def _named(table: pd.DataFrame) -> pd.DataFrame:
    """Table 1 or its means, with names of its rows."""
    names = [full_name(m, n) for m, n in zip(table["method"], table["network"], strict=True)]
    return table.assign(name=names, method=[kind(m) for m in table["method"]])


def layout1(table: pd.DataFrame, caption: str) -> Layout:
    """Table 1: columns grouped by sigma_theta, then sigma_uv, as in the paper; a block for each set of objects."""
    named, cells = _named(table), cells_of(table)
    order = [(uv, theta) for theta, uv in cells]
    blocks = tuple(
        Block(heading, _rows(named[named["objects_of"] == block], order))
        for block, heading in block_names(table).items()
    )
    return Layout(caption, _by_angle(cells), blocks)


def _by_angle(cells: list[tuple[float, float]]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Groups of columns of cells (theta, uv)."""
    return tuple(
        (f"σθ = {theta:g}°", tuple(f"σuv = {uv:g} mm" for t, uv in cells if t == theta))
        for theta in dict.fromkeys(t for t, _ in cells)
    )


def _compared(line: pd.Series | None) -> Cell:
    """A difference with its sign, or a share."""
    if line is None:
        return Cell(BLANK)
    sign = "" if line["comparison"] == SHARE else "+"
    value, low, high = (f"{line[key]:{sign}.3f}".replace("-", "−") for key in ("value", "ci_low", "ci_high"))
    return Cell(value, f"[{low}, {high}]")


def layout_means(means: pd.DataFrame, caption: str) -> Layout:
    """Table 1's means over cells: the blocks side by side, promise and expectation beside success."""
    named, names = _named(means), block_names(means)
    groups = tuple((heading, ("success", "promise", "expected")) for heading in names.values())
    rows = []
    for method in dict.fromkeys(named["method"]):
        of_method = named[named["method"] == method]
        for i, name in enumerate(dict.fromkeys(of_method["name"])):
            cells: list[Cell] = []
            for block in names:
                found = of_method[(of_method["name"] == name) & (of_method["objects_of"] == block)]
                line = found.iloc[0] if len(found) else None
                values = [math.nan] * 2 if line is None else [line["promise"], line["expected"]]
                cells += [_ours(line), *(Cell(number(value)) for value in values)]
            rows.append(Row(name, tuple(cells), ours=True, first=i == 0))
        paper = Cell(number(of_method["paper"].iloc[0])), Cell(BLANK), Cell(BLANK)
        rows.append(Row(f"{method} (paper)", paper * len(names), ours=False, first=False))
    return Layout(caption, groups, (Block("", tuple(rows)),))


def layout_differences(table: pd.DataFrame, block_heads: Mapping[str, str], caption: str) -> Layout:
    """Differences and shares cell by cell, over all cells, and in how many a difference is above 0.

    table: of `differences`; block_heads: as `block_names` has them. The true function's own have no place here.
    """
    shown = table[table["comparison"].isin(SHOWN) & (table["network"] != TRUE)]
    cells = cells_of(shown[shown["sigma_uv_mm"].notna()])
    blocks = []
    for block, heading in block_heads.items():
        rows = []
        own = shown[shown["objects_of"] == block]
        for network, comparison, by in itertools.product(dict.fromkeys(own["network"]), SHOWN, JUDGED):
            lines = own[(own["network"] == network) & (own["comparison"] == comparison) & (own["by"] == by)]
            if lines.empty:
                continue
            of_cells = lines["sigma_uv_mm"].notna()
            found = {(line["sigma_theta_deg"], line["sigma_uv_mm"]): line for _, line in lines[of_cells].iterrows()}
            above = f"{(lines[of_cells]['ci_low'] > 0).sum()} of {len(cells)}"
            values = [_compared(found.get(cell)) for cell in cells]
            values += [_compared(lines[~of_cells].iloc[0]), Cell(BLANK if comparison == SHARE else above)]
            words = comparison.replace("_minus_", " − ").replace("_over_", " / ").title()
            name = f"{words} ({network}), {JUDGED[by]}"
            rows.append(Row(name, tuple(values), ours=True, first=by == TRIALS))
        blocks.append(Block(heading, tuple(rows)))
    groups = (*_by_angle(cells), ("all cells", ("mean", "above 0")))
    return Layout(caption, groups, tuple(blocks))


def layout_sources(table: pd.DataFrame, caption: str) -> Layout:
    """Success by the source of the test objects, a column for each; table: of `tables.by_source`."""
    named, count = _named(table), table.groupby("source")["objects"].max()
    rows = []
    for (_, name), of_name in named.groupby(["method", "name"], sort=False):
        of_source = {line["source"]: line for _, line in of_name.iterrows()}
        cells = tuple(_ours(of_source.get(source)) for source in count.index)
        rows.append(Row(str(name), cells, ours=True, first=False))
    columns = tuple(f"{source} ({objects:,})" for source, objects in count.items())
    return Layout(caption, (("", columns),), (Block("", tuple(rows)),))


def layout2(table: pd.DataFrame, caption: str) -> Layout:
    """Table 2: a column for every condition."""
    named = table.assign(name=table["method"], method=[name.split(" (")[0] for name in table["method"]])
    cells = sorted(set(zip(table["sigma_uv_mm"], table["sigma_theta_deg"], strict=True)))
    columns = tuple(f"σuv = {uv:g} mm, σθ = {theta:g}°" for uv, theta in cells)
    return Layout(caption, (("", columns),), (Block("", _rows(named, cells)),))


def _headings(layout: Layout) -> list[str]:
    """One heading for every column, with that of its group before it."""
    return [f"{group}, {column}" if group else column for group, columns in layout.groups for column in columns]


def _narrow(layout: Layout) -> tuple[str, list[str]]:
    """Heading of the first column and of the others, where many stand under a group: bare numbers, the unit once."""
    if not all(column.startswith("σuv = ") and column.endswith(" mm") for column in layout.columns):
        return "Method", layout.columns
    return "Method (σuv in mm)", [c.removeprefix("σuv = ").removesuffix(" mm") for c in layout.columns]


def to_markdown(layout: Layout) -> str:
    """A Markdown table, its interval under every rate, the caption below."""
    lines = ["| Method | " + " | ".join(_headings(layout)) + " |", "|---" + "|---:" * len(layout.columns) + "|"]
    for block in layout.blocks:
        if block.heading:
            lines.append(f"| **{block.heading}** |" + " |" * len(layout.columns))
        for row in block.rows:
            cells = [f"{cell.rate}<br>{cell.interval}" if cell.interval else cell.rate for cell in row.cells]
            cells = cells if row.ours else [f"*{cell}*" for cell in cells]
            lines.append(f"| {row.name if row.ours else f'*{row.name}*'} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + f"\n\n{layout.caption}\n"


_TEX = {"&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}"}
_TEX |= {"~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "\\": r"\textbackslash{}"}
_TEX_SYMBOLS = {"σuv": r"$\sigma_{uv}$", "σθ": r"$\sigma_\theta$", "°": r"$^\circ$", "–": "--", "“": "``", "”": "''"}


def tex_escape(text: str) -> str:
    """Text that LaTeX sets as it stands, with the symbols of these tables."""
    escaped = "".join(_TEX.get(character, character) for character in text)
    for symbol, command in _TEX_SYMBOLS.items():
        escaped = escaped.replace(symbol, command)
    return escaped


def _tex_row(row: Row) -> list[str]:
    rule = [r"\midrule"] if row.first else []
    rates = [tex_escape(cell.rate) for cell in row.cells]
    if not row.ours:
        italic = [rf"\textit{{{rate}}}" for rate in rates]
        return [*rule, " & ".join([rf"\textit{{{tex_escape(row.name)}}}", *italic]) + r" \\"]
    # \relax: a cell that starts with a bracket would be read as the argument of the line break before it.
    below = [rf"\relax{{\tiny {cell.interval}}}" for cell in row.cells]
    name = rf"\multirow{{2}}{{*}}{{{tex_escape(row.name)}}}"
    return [*rule, " & ".join([name, *rates]) + r" \\", " & ".join(["", *below]) + r" \\"]


def to_tex(layout: Layout, label: str) -> str:
    """A table* for a document with booktabs and multirow: two lines for each of our rows, the interval below."""
    spec = "l" + "".join("@{\\quad}" + "c" * len(columns) for _, columns in layout.groups)
    lines = [r"\begin{table*}", r"\centering", r"\scriptsize", r"\setlength{\tabcolsep}{2pt}"]
    lines += [rf"\begin{{tabular}}{{{spec}}}", r"\toprule"]
    if any(group for group, _ in layout.groups):
        spans = [rf"\multicolumn{{{len(columns)}}}{{c}}{{{tex_escape(group)}}}" for group, columns in layout.groups]
        lines.append(" & ".join(["", *spans]) + r" \\")
    first, columns = _narrow(layout)
    lines += [" & ".join(map(tex_escape, [first, *columns])) + r" \\"]
    for block in layout.blocks:
        if block.heading:
            span = len(layout.columns) + 1
            lines += [r"\midrule", rf"\multicolumn{{{span}}}{{l}}{{\textbf{{{tex_escape(block.heading)}}}}} \\"]
        for row in block.rows:
            lines += _tex_row(row)
    lines += [r"\bottomrule", r"\end{tabular}"]
    lines += [rf"\caption{{{tex_escape(layout.caption)}}}", rf"\label{{{label}}}", r"\end{table*}"]
    return "\n".join(lines) + "\n"


def _symbols(text: str) -> str:
    return html.escape(text).replace("σuv", "σ<sub>uv</sub>").replace("σθ", "σ<sub>θ</sub>")


def _html_row(row: Row, edge: list[str]) -> str:
    """edge: an attribute for every column."""
    kind = " ".join(["ours" if row.ours else "paper", *(["first"] if row.first else [])])
    cells = "".join(
        f"<td{edge[i]}>{cell.rate}" + (f"<small>{cell.interval}</small>" if cell.interval else "") + "</td>"
        for i, cell in enumerate(row.cells)
    )
    return f"<tr class='{kind}'><th class='name'>{html.escape(row.name)}</th>{cells}</tr>"


def to_html(layout: Layout) -> str:
    """The table alone (no caption), intervals in smaller type."""
    lines = ["<table class='results'><thead>"]
    if any(group for group, _ in layout.groups):
        spans = "".join(
            f"<th class='group' colspan='{len(columns)}'>{_symbols(group)}</th>" for group, columns in layout.groups
        )
        lines.append(f"<tr><th></th>{spans}</tr>")
    starts = {sum(len(columns) for _, columns in layout.groups[:i]) for i in range(len(layout.groups))}
    edge = [" class='start'" if i in starts else "" for i in range(len(layout.columns))]
    first, columns = _narrow(layout)
    headings = "".join(f"<th{edge[i]}>{_symbols(name)}</th>" for i, name in enumerate(columns))
    lines.append(f"<tr><th class='name'>{_symbols(first)}</th>{headings}</tr></thead><tbody>")
    for block in layout.blocks:
        if block.heading:
            span = len(layout.columns) + 1
            lines.append(f"<tr class='block'><th class='name' colspan='{span}'>{html.escape(block.heading)}</th></tr>")
        lines += [_html_row(row, edge) for row in block.rows]
    return "\n".join([*lines, "</tbody></table>"])
