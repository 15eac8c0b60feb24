import itertools
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from made_trials import CELLS, ERRORS, HELD, LABELLED, TRUE, account, simulated_trials

from graspfn.evaluation.statistics import proportion, resampled_rate
from graspfn.reporting import layout, paper, tables
from graspfn.reporting.metrics import (
    TABLE_2_PAIR,
    label_numbers,
    robot_numbers,
    robust_gain,
    rounded,
    simulation_numbers,
    source_numbers,
)
from graspfn.reporting.plans import ALL, GRASPABLE, graspable_objects, plans_of
from graspfn.reporting.summary import in_readme, results_sentence

METHODS = ("Centroid", "Best Grasp", "Robust Best Grasp")
SURE = graspable_objects(account(), 5)
SOURCE = {f"o{i}": "made" for i in range(10)}


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


@pytest.fixture(scope="module")
def plans():
    return plans_of(simulated_trials())


@pytest.fixture(scope="module")
def table_1(plans):
    return tables.table1(plans, SURE)


@pytest.fixture(scope="module")
def table_2():
    return tables.table2(robot_trials())


def test_table_1_has_a_row_per_block_method_network_and_cell_in_the_papers_order(table_1):
    assert list(table_1.columns) == tables.TABLE_1_COLUMNS
    assert len(table_1) == 2 * len(HELD) * len(CELLS)
    for block, objects in ((ALL, 10), (GRASPABLE, 7)):
        own = table_1[table_1["objects_of"] == block]
        rows = own[["method", "network"]].drop_duplicates().itertuples(index=False, name=None)
        assert list(rows) == list(HELD)
        assert own["objects"].max() == objects
        assert (own["trials"] == own["objects"] * ERRORS).all() and (own["networks"] == 1).all()


def test_rates_are_those_of_the_trials_and_intervals_those_of_their_objects(table_1):
    for row in table_1.itertuples():
        objects = range(LABELLED if row.network == TRUE else 10) if row.objects_of == ALL else range(2, LABELLED)
        held = np.array([[float(i < HELD[row.method, row.network])] for i in objects])
        rate = resampled_rate(held)
        assert (row.success, row.ci_low, row.ci_high) == (rate.value, rate.low, rate.high)


def test_which_objects_can_be_held_the_labels_decide_and_no_trial(plans):
    """o0 is held in every trial, but no pose of it is sure; nothing holds o8, but it has a sure pose."""
    assert {f"o{i}" for i in range(2, LABELLED)} == SURE
    never = plans_of(simulated_trials().assign(success=False))
    for of in (plans, never):
        table = tables.table1(of, SURE)
        assert table.loc[table["objects_of"] == GRASPABLE, "objects"].unique().tolist() == [7]
    failed = account().assign(status="crashed")
    assert graspable_objects(failed, 5) == frozenset()
    assert set(tables.table1(plans, frozenset())["objects_of"]) == {ALL}


def test_true_functions_rows_stand_where_objects_are_labelled(table_1):
    own = table_1[table_1["network"] == TRUE]
    assert own.loc[own["objects_of"] == ALL, "objects"].unique().tolist() == [LABELLED]
    assert own["expected"].notna().all() and own["promise"].notna().all()
    assert f"(known for {LABELLED} test objects, the labelled ones)" in tables.caption1(table_1, "made")


def test_expected_is_the_mean_over_the_objects_that_have_one(table_1):
    for row in table_1[table_1["network"] != TRUE].itertuples():
        objects = range(LABELLED) if row.objects_of == ALL else range(2, LABELLED)
        held = [i < HELD[row.method, row.network] for i in objects]
        assert row.expected == pytest.approx(np.mean(held))
        assert row.expected_error == pytest.approx(0.1 / np.sqrt(len(held)))


def test_an_expectation_from_too_few_attempts_is_left_out_and_that_of_no_grasp_is_0():
    trials = simulated_trials()
    fcn = (trials["method"] == "Best Grasp") & (trials["network"] == "fcn")
    trials.loc[fcn & (trials["id"] == "o0"), "effective"] = 3.0
    given_up = fcn & trials["id"].isin(["o1", "o9"])  # o9 has no labels: nobody knows what to expect of it
    trials.loc[given_up, ["u_m", "expected", "expected_error", "promise"]] = np.nan
    trials.loc[given_up, "success"] = False
    plans = plans_of(trials)
    own = plans[(plans["method"] == "Best Grasp") & (plans["network"] == "fcn")].set_index("id")
    assert own.loc["o0", "few"].all() and own.loc["o0", "expected"].isna().all()
    assert (own.loc["o1", "expected"] == 0).all() and not own.loc["o1", "few"].any()
    assert own.loc["o9", "expected"].isna().all()
    assert (own.loc[["o1", "o9"], "no_grasp"] == ERRORS).all() and own.loc["o0", "no_grasp"].eq(0).all()


def test_training_seeds_are_trained_networks_and_the_caption_says_how_many():
    table = tables.table1(plans_of(simulated_trials(seeds=(0, 1, 2))), SURE)
    assert table.groupby("network")["networks"].max().to_dict() == {"": 1, "fcn": 3, TRUE: 1}
    assert (table["trials"] == table["objects"] * table["networks"] * ERRORS).all()
    assert "resampling objects and the 3 training seeds of each network" in tables.caption1(table, "made")
    once = tables.caption1(tables.table1(plans_of(simulated_trials()), SURE), "made")
    assert "each network was trained once, and what another start of it would bring they do not hold" in once


def test_caption_of_table_1_counts_objects_of_each_block_and_errors(table_1):
    caption = tables.caption1(table_1, "made")
    assert "all 10 test objects and the 7 test objects that can be held, each with 4 errors in every cell" in caption
    assert "Centroid, which needs no network, is the floor" in caption


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
            assert row.paper == paper.TABLE_1[tables.kind(row.method), 5.0, row.sigma_theta_deg]
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
    plans = plans_of(simulated_trials().assign(method="Luckiest Grasp"))
    with pytest.raises(ValueError, match="Luckiest Grasp"):
        tables.table1(plans, SURE)


def test_caption_of_table_2_says_who_recorded(table_2):
    for simulated, said in ((True, "made by a simulated robot"), (False, "made by a real robot")):
        assert said in tables.caption2(table_2, robot_trials(simulated), "smoke")
    mixed = robot_trials()
    mixed.loc[:9, "simulated"] = False
    assert "70 of the 80 recordings were made by a simulated robot" in tables.caption2(table_2, mixed, "smoke")


ROWS = [
    "Centroid",
    "Centroid (paper)",
    "Best Grasp (fcn, likeliest class)",
    "Best Grasp (fcn)",
    "Best Grasp (true function)",
    "Best Grasp (paper)",
    "Robust Best Grasp (fcn)",
    "Robust Best Grasp (true function)",
    "Robust Best Grasp (paper)",
]


def test_layout_has_every_rate_once_and_the_papers_row_after_each_method(table_1):
    laid_out = layout.layout1(table_1, "caption")
    assert [group for group, _ in laid_out.groups] == ["σθ = 10°", "σθ = 40°"]
    headings = [block.heading for block in laid_out.blocks]
    assert headings == ["All 10 test objects", "The 7 test objects that can be held"]
    for block in laid_out.blocks:
        assert [row.name for row in block.rows] == ROWS
        printed = [cell.rate for cell in block.rows[-1].cells]
        assert printed == ["0.838", layout.BLANK, "0.767", layout.BLANK]
    ours = [float(cell.rate) for block in laid_out.blocks for row in block.rows if row.ours for cell in row.cells]
    assert sorted(ours) == pytest.approx(sorted(table_1["success"]), abs=5e-4)


def test_a_cell_without_trials_is_a_dash(table_1):
    laid_out = layout.layout1(table_1.iloc[1:], "caption")
    assert laid_out.blocks[0].rows[0].cells[0] == layout.Cell(layout.BLANK)


def test_markdown_is_rectangular_and_ends_with_the_caption(table_1):
    text = layout.to_markdown(layout.layout1(table_1, "the caption"))
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert {line.count("|") for line in lines} == {6}
    assert len(lines) == 2 + 2 * (1 + len(ROWS)) and text.endswith("the caption\n")


def test_means_are_those_of_the_cells_with_the_blocks_side_by_side(plans, table_1):
    means = tables.means1(plans, SURE)
    for row in means.itertuples():
        cells = table_1[(table_1["method"] == row.method) & (table_1["network"] == row.network)]
        assert row.success == pytest.approx(cells.loc[cells["objects_of"] == row.objects_of, "success"].mean())
    laid_out = layout.layout_means(means, tables.caption_means(means))
    assert [row.name for row in laid_out.blocks[0].rows] == ROWS and len(laid_out.columns) == 6
    reader = TableReader()
    reader.feed(layout.to_html(laid_out))
    assert set(reader.rows) == {7}


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
    spans = [line for line in body.splitlines() if line.startswith(r"\multicolumn")]
    assert all(line.startswith(rf"\multicolumn{{{columns}}}") for line in spans)
    rows = [line for line in body.splitlines() if line.endswith(r"\\") and line not in spans]
    assert {line.count("&") + 1 for line in rows} == {columns}
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
    assert set(reader.rows) == {5} and len(reader.rows) == 2 + 2 * (1 + len(ROWS))


def test_robust_gain_pairs_trials_whatever_their_order():
    shuffled = robot_trials().sample(frac=1, random_state=1)
    held = (shuffled["method"] == "Best Grasp") & (shuffled["object"] == "o0")
    gain = robust_gain(shuffled.assign(success=shuffled["success"] & ~held), "fcn", "object", TABLE_2_PAIR)
    assert gain.pairs == 16 and gain.clusters == 4
    assert gain.value == pytest.approx(0.25)
    assert gain.low < 0.25 < gain.high


@pytest.mark.parametrize("apart", ["placement", "method"])
def test_methods_that_shared_no_trial_have_no_gain(apart):
    """A robot may have tried each method on placements of its own, or one method alone."""
    trials = robot_trials()
    trials = (
        trials[trials["method"] != "Best Grasp"] if apart == "method" else trials.assign(placement=trials["method"])
    )
    assert robust_gain(trials, "fcn", "object", TABLE_2_PAIR) is None
    found = robot_numbers(trials)
    assert "robust_best_grasp" in found["fcn"] and "robust_minus_best" not in found["fcn"]


def test_sources_weighed_by_their_objects_are_the_whole(plans):
    source = {name: "ycb" if i % 3 else "procedural" for i, name in enumerate(sorted(set(plans["id"])))}
    table = tables.by_source(plans, source)
    ours = table[table["network"] != TRUE]  # which only the labelled objects have
    whole = tables.means1(plans, SURE).query("objects_of == @ALL").set_index(["method", "network"])["success"]
    for key, rows in ours.groupby(["method", "network"]):
        assert (rows["success"] * rows["objects"]).sum() / rows["objects"].sum() == pytest.approx(whole[key]), key
    assert ours.groupby("source")["objects"].max().to_dict() == {"procedural": 4, "ycb": 6}
    shown = layout.layout_sources(table, "")
    assert shown.columns == ["procedural (4)", "ycb (6)"]
    first = table[(table["source"] == "ycb") & (table["method"] == METHODS[0])].iloc[0]
    assert shown.blocks[0].rows[0].cells[1].rate == f"{first['success']:.3f}"
    numbers = source_numbers(table)
    assert numbers["ycb"]["centroid"]["success"] == pytest.approx(first["success"])
    assert numbers["procedural"]["fcn"].keys() >= {"best_grasp", "robust_best_grasp"}


@pytest.fixture(scope="module")
def numbers(plans):
    return {"table1": rounded(simulation_numbers(plans, SURE, tables.Tables1.of(plans, SURE, SOURCE)))}


def test_metrics_hold_the_means_of_both_blocks_and_the_differences_of_every_cell(numbers):
    every, held = numbers["table1"][ALL], numbers["table1"][GRASPABLE]
    assert every["objects"] == 10 and held["objects"] == 7
    assert every["centroid"]["mean_success"] == 0.3
    assert every["fcn"]["robust_best_grasp"]["mean_success"] == 0.7
    assert every["fcn"]["best_grasp_likeliest_class"]["mean_success"] == 0.4
    assert held["fcn"]["robust_best_grasp"]["success_uv5_theta10"]["value"] == pytest.approx(5 / 7, abs=1e-4)
    assert every["true_function"]["robust_best_grasp"]["objects"] == LABELLED
    gaps = {
        "robust_minus_best": 0.2,
        "robust_minus_likeliest": 0.3,
        "best_minus_centroid": 0.2,
        "robust_minus_centroid": 0.4,
    }
    for name, value in gaps.items():
        found = every["fcn"][name]
        assert found["value"] == value and found["ci_low"] < value < found["ci_high"]
        assert set(found["cells"]) == {"uv5_theta10", "uv12_5_theta10", "uv5_theta40", "uv12_5_theta40"}
    assert every["fcn"]["ceiling_minus_robust"]["value"] == pytest.approx(1 / 9, abs=1e-4)


def test_the_sentence_of_results_says_the_numbers_of_the_metrics(numbers, plans):
    said = results_sentence(numbers)
    assert "On the 7 test objects that can be held, Robust Best Grasp of `fcn` succeeds in 0.714" in said
    assert "+0.286" in said and "0.838" in said and "the ceiling, reaches 0.857" in said
    assert "By the labels, Robust Best Grasp reaches 0.833 [" in said
    assert in_readme(f"a\n<!-- results -->\n{said.replace(' ', chr(10), 3)}\n<!-- /results -->\nb") == said
    cell = (plans["sigma_theta_deg"] == 10.0) & (plans["sigma_uv_mm"] == 5.0) & (plans["network"] == "fcn")
    worse = plans.assign(expected=plans["expected"].where(~cell, plans["expected"] / 2))
    numbers = rounded(simulation_numbers(worse, SURE, tables.Tables1.of(worse, SURE, SOURCE)))
    said = results_sentence({"table1": numbers})
    assert "By the labels, Robust Best Grasp reaches 0.729 [" in said
    assert "of what planning by them does, and 0.417 in the worst cell." in said
    alone = plans[plans["network"] != TRUE]
    unknown = rounded(simulation_numbers(alone, frozenset(), tables.Tables1.of(alone, frozenset(), SOURCE)))
    said = results_sentence({"table1": unknown})
    assert "On all 10 test objects, " in said and "ceiling" not in said


def test_a_cell_with_different_injected_errors_says_so():
    trials = robot_trials().assign(injected_uv_mm=np.nan, injected_theta_deg=np.nan)
    assert "injected" not in tables.caption2(tables.table2(trials), trials, "smoke")
    trials.loc[trials.index[0], ["injected_uv_mm", "injected_theta_deg"]] = 5.0
    said = "1 of the conditions pool trials with different errors injected on purpose"
    assert said in tables.caption2(tables.table2(trials), trials, "smoke")


def test_numbers_of_robot_and_labels():
    found = robot_numbers(robot_trials())
    assert found["fcn"]["best_grasp"]["success_uv6_2_theta4_7"] == 0.75
    crashed = pd.DataFrame([{"id": "b", "status": "crashed", "best": 0}])
    labels = label_numbers(pd.concat([account().head(1), crashed]), 5)
    assert labels["objects"] == 1 and labels["attempts"] == 100
    assert labels["held_share_of_touching"] == 0.25


def test_what_json_does_not_have_is_null():
    assert rounded({"a": float("nan"), "b": -np.inf, "c": 0.123456}) == {"a": None, "b": None, "c": 0.1235}
