import itertools
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from graspfn.evaluation.statistics import proportion
from graspfn.reporting import layout, paper, tables
from graspfn.reporting.metrics import TABLE_2_PAIR, metrics, robust_gain

METHODS = ("Centroid", "Best Grasp", "Robust Best Grasp")
SUCCESSES = {"Centroid": 3, "Best Grasp": 5, "Robust Best Grasp": 8}  # of ten objects


def simulated_trials():
    rows = []
    for theta, uv, method in itertools.product((10.0, 40.0), (5.0, 12.5), METHODS):
        for network in [""] if method == "Centroid" else ["alexnet", "fcn"]:
            held = SUCCESSES[method] - (network == "alexnet")
            rows += [
                {"id": f"o{i}", "method": method, "network": network, "sigma_uv_mm": uv, "sigma_theta_deg": theta}
                | {"success": i < held, "u_m": 0.0}
                for i in range(10)
            ]
    return pd.DataFrame(rows).sample(frac=1, random_state=0)


def robot_trials(simulated=True):
    rows = []
    for (uv, theta), method, i, placement in itertools.product(
        ((6.2, 4.7), (20.0, 15.0)), METHODS, range(4), ("0", "1")
    ):
        for network in [""] if method == "Centroid" else ["alexnet", "fcn"]:
            rows.append(
                {"object": f"o{i}", "placement": placement, "method": method, "network": network, "sigma_uv_mm": uv}
                | {
                    "sigma_theta_deg": theta,
                    "success": i < 3 and method != "Centroid",
                    "simulated": simulated,
                    "u_m": 0.0,
                }
            )
    return pd.DataFrame(rows)


def account():
    return pd.DataFrame(
        [
            {
                "id": "a",
                "status": "labelled",
                "best": 5,
                "untouched": 60,
                "held": 10,
                "left": 20,
                "missed": 5,
                "collided": 5,
            }
            | {"diverged": 0},
            {"id": "b", "status": "crashed", "best": 0},
        ]
    )


@pytest.fixture(scope="module")
def table_1():
    return tables.table1(simulated_trials())


@pytest.fixture(scope="module")
def table_2():
    return tables.table2(robot_trials())


def test_table_1_has_a_row_per_method_network_and_cell_in_the_papers_order(table_1):
    assert list(table_1.columns) == tables.TABLE_1_COLUMNS
    assert len(table_1) == 5 * 4
    assert list(dict.fromkeys(table_1["method"])) == list(METHODS)
    assert (table_1["trials"] == 10).all() and (table_1["objects"] == 10).all()


def test_rates_and_intervals_are_those_of_the_trials(table_1):
    for row in table_1.itertuples():
        held = SUCCESSES[row.method] - (row.network == "alexnet")
        expected = proportion(np.arange(10) < held)
        assert (row.success, row.ci_low, row.ci_high) == (expected.value, expected.low, expected.high)


def test_trials_of_one_object_are_one_cluster(table_2):
    """Eight trials of four objects that always agree: as wide as four trials can make it, not eight."""
    row = table_2[table_2["method"] == "Best Grasp (fcn)"].iloc[0]
    assert (row["trials"], row["objects"]) == (8, 4)
    independent = proportion(np.arange(8) < 6)
    assert row["ci_high"] - row["ci_low"] > independent.high - independent.low


def test_papers_figures_stand_in_the_cells_they_are_of_and_nowhere_else(table_1, table_2):
    assert list(table_2.columns) == tables.TABLE_2_COLUMNS
    for row in table_1.itertuples():
        if row.sigma_uv_mm == 12.5:  # not one of the paper's
            assert np.isnan(row.paper)
        else:
            assert row.paper == paper.TABLE_1[row.method, 5.0, row.sigma_theta_deg]
    for row in table_2.itertuples():
        assert row.paper == paper.TABLE_2[row.method.split(" (")[0], row.sigma_uv_mm, row.sigma_theta_deg]


def test_all_numbers_are_those_the_paper_prints():
    source = Path(__file__).parents[1] / "../shared/paper.tex"
    if not source.exists():
        pytest.skip("the paper's source is not here")
    printed = {method: [] for method in METHODS}
    for line in source.read_text().splitlines():
        name, *cells = (cell.strip() for cell in line.replace(r"\\", "").split("&"))
        if name in printed:
            printed[name].append([float(cell) for cell in cells])
    for method, (row_1, row_2) in printed.items():
        cells = itertools.product((10, 20, 30, 40), (5, 10, 15, 20))
        assert row_1 == [paper.table_1(method, uv, theta) for theta, uv in cells]
        assert row_2 == [paper.table_2(method, 6.2, 4.7), paper.table_2(method, 20, 15)]
    assert len(paper.TABLE_1) == 48


def test_an_unknown_method_is_refused():
    trials = simulated_trials().assign(method="Luckiest Grasp")
    with pytest.raises(ValueError, match="Luckiest Grasp"):
        tables.table1(trials)


def test_caption_of_table_2_says_who_recorded(table_2):
    for simulated, said in ((True, "made by a simulated robot"), (False, "made by a real robot")):
        assert said in tables.caption2(table_2, robot_trials(simulated), "smoke")
    mixed = robot_trials()
    mixed.loc[:9, "simulated"] = False
    assert "70 of the 80 recordings were made by a simulated robot" in tables.caption2(table_2, mixed, "smoke")


def test_layout_has_every_rate_once_and_the_papers_row_after_each_method(table_1):
    laid_out = layout.layout1(table_1, "caption")
    assert [group for group, _ in laid_out.groups] == ["σθ = 10°", "σθ = 40°"]
    assert [row.name for row in laid_out.rows] == [
        "Centroid",
        "Centroid (paper)",
        "Best Grasp (alexnet)",
        "Best Grasp (fcn)",
        "Best Grasp (paper)",
        "Robust Best Grasp (alexnet)",
        "Robust Best Grasp (fcn)",
        "Robust Best Grasp (paper)",
    ]
    printed = [cell.rate for cell in laid_out.rows[-1].cells]
    assert printed == ["0.838", layout.BLANK, "0.767", layout.BLANK]
    ours = [float(cell.rate) for row in laid_out.rows if row.ours for cell in row.cells]
    assert sorted(ours) == pytest.approx(sorted(table_1["success"]))


def test_a_cell_without_trials_is_a_dash(table_1):
    laid_out = layout.layout1(table_1.iloc[1:], "caption")
    assert laid_out.rows[0].cells[0] == layout.Cell(layout.BLANK)


def test_markdown_is_rectangular_and_ends_with_the_caption(table_1):
    text = layout.to_markdown(layout.layout1(table_1, "the caption"))
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert {line.count("|") for line in lines} == {6}
    assert len(lines) == 2 + 8 and text.endswith("the caption\n")


@pytest.mark.parametrize("which", ["layout1", "layout2"])
def test_tex_is_balanced_rectangular_and_escaped(which, table_1, table_2):
    table = table_1 if which == "layout1" else table_2
    text = layout.to_tex(getattr(layout, which)(table, "100% of σuv_x & more #1"), "tab:x")
    bare = re.sub(r"\\[{}]", "", text)
    assert bare.count("{") == bare.count("}")
    assert re.findall(r"\\begin\{(.+?)\}", text) == re.findall(r"\\end\{(.+?)\}", text)[::-1]
    assert text.isascii()
    assert r"100\% of $\sigma_{uv}$\_x \& more \#1" in text
    columns = 1 + len(set(zip(table["sigma_uv_mm"], table["sigma_theta_deg"], strict=True)))
    body = text.split(r"\midrule", 1)[1].split(r"\bottomrule")[0]
    assert {line.count("&") + 1 for line in body.splitlines() if line.endswith(r"\\")} == {columns}
    # After a line break LaTeX takes a bracket for its optional argument.
    assert not re.search(r"\\\\\s*\[", text)


class TableReader(HTMLParser):
    def __init__(self):
        super().__init__()
        self.rows = []

    def handle_starttag(self, tag, attrs):
        if tag == "tr":
            self.rows.append(0)
        if tag in ("th", "td"):
            self.rows[-1] += int(dict(attrs).get("colspan", 1))


def test_html_table_is_rectangular(table_1):
    reader = TableReader()
    reader.feed(layout.to_html(layout.layout1(table_1, "")))
    assert set(reader.rows) == {5} and len(reader.rows) == 2 + 8


def test_robust_gain_pairs_trials_whatever_their_order():
    gain = robust_gain(simulated_trials(), "fcn", "id", ["id", "sigma_uv_mm", "sigma_theta_deg"])
    assert gain.pairs == 40 and gain.clusters == 10
    assert gain.value == pytest.approx(0.3)
    assert gain.low < 0.3 < gain.high


@pytest.mark.parametrize("apart", ["placement", "method"])
def test_methods_that_shared_no_trial_have_no_gain(apart):
    """A robot may have tried each method on placements of its own, or one method alone."""
    trials = robot_trials()
    trials = (
        trials[trials["method"] != "Best Grasp"] if apart == "method" else trials.assign(placement=trials["method"])
    )
    assert robust_gain(trials, "fcn", "object", TABLE_2_PAIR) is None
    found = metrics(simulated_trials(), trials, account(), 5, {})
    assert "robust_best_grasp" in found["table2"]["fcn"] and "robust_minus_best" not in found["table2"]["fcn"]
    assert "robust_minus_best" in found["table1"]["fcn"]


def test_metrics_hold_the_tables_means_and_the_labels_shares():
    history = pd.DataFrame({"loss": np.r_[np.ones(95), np.full(5, 0.123456)]})
    found = metrics(simulated_trials(), robot_trials(), account(), 5, {"fcn": history})
    assert found["table1"]["fcn"]["robust_best_grasp"]["mean_success"] == 0.8
    assert found["table1"]["alexnet"]["best_grasp"]["success_uv5_theta10"] == 0.4
    assert found["table1"]["centroid"]["mean_success"] == 0.3
    assert found["table2"]["fcn"]["best_grasp"]["success_uv6_2_theta4_7"] == 0.75
    assert found["table2"]["simulated_recordings"] == 80
    assert found["labels"]["objects"] == 1 and found["labels"]["attempts"] == 100
    assert found["labels"]["held_share_of_touching"] == 0.25
    assert found["training"]["fcn"]["final_loss"] == 0.1235
