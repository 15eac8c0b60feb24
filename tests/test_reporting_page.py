"""The whole report of a tiny made-up workflow: two boxes to train on, two to test on, one network.

A third box of each split never comes to rest.
"""

import dataclasses
import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import trimesh
import yaml
from made_trials import disturbed_plans
from test_robot_recording import write_trial

from graspfn.evaluation.planner import TRUE
from graspfn.geometry import grid
from graspfn.imaging.camera import Camera
from graspfn.imaging.render import render_depth
from graspfn.meshes.placed import T_world_object, placed_row, write_placed
from graspfn.params import read_yaml, validate
from graspfn.reporting import page
from graspfn.reporting.failures import write_failures
from graspfn.reporting.figures import nearest, registry, shading
from graspfn.reporting.inputs import FAILURES, example_label, load_inputs, spread
from graspfn.reporting.page import Picture
from graspfn.reporting.report import write_report, write_tables
from graspfn.reporting.robustness import COLUMNS, robustness_table
from graspfn.reporting.summary import results_sentence
from graspfn.reporting.tables import Tables1
from graspfn.robot.analyse import analyse
from graspfn.robot.gantry import FINGER_JOINTS
from graspfn.robot.read import read_trial, recordings
from graspfn.robot.source import source_of
from graspfn.robot.trial import Condition, TrialRecording
from graspfn.selection.written import Object, write_objects
from graspfn.workflow.files import write_npz, write_parquet

ROOT = Path(__file__).parents[1]
SIGMAS = ((5.0, 10.0), (20.0, 10.0))


def plans():
    return [("Centroid", ""), ("Best Grasp", "fcn"), ("Robust Best Grasp", "fcn")]


def write_split(data, split, camera):
    boxes, rows = [], []
    for i in range(3):
        name, height = f"made-box-{split}-{i}", 0.03 + 0.01 * i
        mesh = trimesh.creation.box([0.12, 0.03, height])
        row = {
            "id": name,
            "source": "made",
            "name": name,
            "class": f"box_{i}",
            "family": "box",
            "licence": "CC0 & more",
        }
        row |= {"split": split, "shape": name, "signature": [0.0], "scale": 1.0, "size_m": 0.12}
        if split == "test":  # the third never comes to rest
            row |= {"nearest": "made-box-train-0", "nearest_distance": (0.3, 0.012, 0.006)[i]}
        else:
            row |= {"nearest": "", "nearest_distance": np.nan}
        row |= {"volume_m3": mesh.volume, "mass": "volume" if i else "convex hull", "watertight": True, "faces": 12}
        boxes.append(Object(row | {"collision_faces": 12, "cleaning": "", "seed_index": i}, mesh, mesh))
        T = np.eye(4)
        T[2, 3] = height / 2
        rows.append(placed_row(name, row["class"], "rolled away" if i == 2 else "resting", T))
    write_objects(data / "objects" / split, data / "collision" / split, boxes)
    placed = write_placed(data / "placed" / f"{split}.parquet", rows)
    resting = placed[placed["status"] == "resting"].to_dict("records")
    images = [render_depth(box.mesh, T_world_object(row), camera) for box, row in zip(boxes, resting, strict=False)]
    (data / "images").mkdir(exist_ok=True)
    np.save(data / f"images/{split}.npy", np.stack(images))
    index = [{"row": i, "id": row["id"], "class": row["class"]} for i, row in enumerate(resting)]
    write_parquet(data / f"images/{split}.parquet", pd.DataFrame(index))
    return [row["id"] for row in resting], images


def write_data(data, params):
    camera = Camera.from_params(params.camera)
    rejects = pd.DataFrame(
        [{"split": "train", "source": "made", "name": "sheet", "class": "", "reason": "flat: <1 mm"}]
    )
    write_parquet(data / "objects/rejects.parquet", rejects)
    trained, _ = write_split(data, "train", camera)
    tested, images = write_split(data, "test", camera)
    f = np.zeros((2, *grid.SHAPE))
    f[:, 15:18, 19:25, 3] = 1.0  # across the long side
    f[1, 15:18, 18, 3] = 0.4
    successes = (5 * f).astype(np.uint8)
    write_npz(data / "labels/train.npz", {"ids": np.array(trained), "successes": successes, "attempts": np.array(5)})
    ended = {"untouched": 40000, "held": 90, "collided": 10, "missed": 20, "left": 30, "diverged": 1}
    for split, names in (("train", trained), ("test", tested)):  # of the test objects one can be held
        rows = [{"id": i, "status": "labelled", "best": 5 if k == 0 else 4} | ended for k, i in enumerate(names)]
        write_parquet(data / f"labels/{split}.parquet", pd.DataFrame(rows))
    write_npz(
        data / "functions/fcn-0.npz",
        {"ids": np.array(tested), "input": np.array("height_map"), "scores": f.astype(np.float32)},
    )
    for folder, steps in (("pretrained", 0), ("networks", 20)):
        (data / folder / "fcn-0").mkdir(parents=True)
        step = np.arange(steps)
        table = pd.DataFrame({"step": step, "epoch": step / 10, "learning_rate": 1e-3, "loss": 1 / (1 + step)})
        table.to_csv(data / folder / "fcn-0/history.csv", index=False)
    rows = [
        {"id": name, "method": method, "network": network, "sigma_uv_mm": uv, "sigma_theta_deg": theta, "error": error}
        | {"training_seed": 0 if network == "fcn" else -1, "success": method != "Best Grasp" or uv < 10, "u_m": 0.0}
        | {"promise": 0.8 if network else np.nan, "expected": np.nan if network == TRUE else 0.6}
        | {"expected_error": np.nan if network == TRUE else 0.1, "effective": 40.0}
        for name in tested
        for uv, theta in SIGMAS
        for method, network in [*plans(), ("Best Grasp", TRUE), ("Robust Best Grasp", TRUE)]
        for error in range(2)
    ]
    write_parquet(data / "trials.parquet", pd.DataFrame(rows))
    write_parquet(data / "robustness.parquet", disturbed_plans(tested))
    (data / "recordings").mkdir()
    rng = np.random.default_rng(0)
    for i, (uv, theta) in enumerate(SIGMAS):
        for k, (name, depth) in enumerate(zip(tested, images, strict=True)):
            for method, network in plans():
                condition = Condition(name, "0", method, network, uv, theta, simulated=True)
                q = np.array([0.0, 0.0, np.pi / 2])
                holes = np.where(rng.random(depth.shape) < 0.01, np.nan, depth).astype(np.float32)
                reached = q + rng.normal(0, 0.01, 3)
                joints = (FINGER_JOINTS, np.array([2.2, 2.4, 2.6]), np.repeat([[-0.27], [-0.1], [0.0]], 2, axis=1))
                held = method != "Best Grasp" or uv < 10
                trial = TrialRecording(condition, holes, camera.matrix, q, reached, *joints, success=held)
                path = data / f"recordings/{i}-{k}-{method.replace(' ', '')}.mcap"
                write_trial(path, trial, params.topics, "32FC1")
    analyse_recordings(data, params)


def analyse_recordings(data, params):
    """As stage analyse_robot does."""
    folder, (_, arm) = data / "recordings", source_of(params.robot, params.arm, params.gripper)
    found = analyse(recordings(folder), params.topics, arm)
    opening_mm = params.gripper.opening_mm
    write_failures(data / FAILURES, found.trials, folder, params.topics, arm, {}, opening_mm, None, None)
    write_parquet(data / "robot_trials.parquet", found.trials)
    write_parquet(data / "robot_uncertainty.parquet", found.uncertainty)
    write_parquet(data / "robot_unused.parquet", found.unused)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    values = read_yaml(ROOT / "params.yaml")
    values |= {"networks": ["fcn"], "scale": "made-up"}
    values["gripper"]["name"] = "made <up> & tiny"
    params = validate(values)
    data = tmp_path_factory.mktemp("workflow") / "data"
    data.mkdir()
    write_data(data, params)
    return load_inputs(data, params, {"evaluate": 75.0})


@pytest.fixture(scope="module")
def report(inputs, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    patch = pytest.MonkeyPatch()
    patch.setattr(shading, "SAMPLES", 1)  # coarse pictures: a quarter of the rays
    write_report(inputs, folder)
    again = tmp_path_factory.mktemp("again")
    write_report(inputs, again)
    patch.undo()
    return folder, again


class Page(HTMLParser):
    """Tags opened and closed in order, and every address that the page refers to."""

    EMPTY = frozenset({"meta", "img", "br", "link"})

    def __init__(self):
        super().__init__()
        self.open, self.addresses, self.text, self.misplaced = [], [], [], []

    def handle_starttag(self, tag, attrs):
        if tag not in self.EMPTY:
            self.open.append(tag)
        self.addresses += [value for name, value in attrs if name in ("src", "href", "srcset", "data")]

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.misplaced.append(tag)

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def html(report):
    return (report[0] / "index.html").read_text()


@pytest.fixture(scope="module")
def parsed(html):
    reader = Page()
    reader.feed(html)
    return reader


def test_a_grasp_that_labelling_scored_was_filmed_to_the_top(inputs):
    assert inputs.film is not None and inputs.film.outcome == "held"
    assert [shot.title for shot in inputs.film.shots] == ["hand in place", "fingers closed", "5 cm up", "20 cm up"]
    assert inputs.film.shots[-1].T_world_object[2, 3] > 0.18


def test_as_many_attempts_that_failed_were_filmed_as_held(inputs):
    films = inputs.films
    assert {film.outcome for film in films["held"]} == {"held"}
    assert {film.outcome for film in films["failed"]} <= {"missed", "left"}
    assert len({film.id for group in films.values() for film in group}) == len(films["held"]) + len(films["failed"])
    assert films["held"] and films["failed"]


def test_the_same_inputs_give_the_same_bytes(report):
    folder, again = report
    files = sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    assert files == sorted(path.relative_to(again) for path in again.rglob("*") if path.is_file())
    for file in files:
        assert (folder / file).read_bytes() == (again / file).read_bytes(), file


def test_every_figure_is_there_as_png_and_pdf(report, html):
    names = {
        *("summary_1d", "grasp_function", "training_example", "predictions", "growing_uncertainty"),
        *("success_vs_sigma_uv", "training_curves", "label_outcomes", "noise", "inpainting", "example_grasps"),
        *("simulated_grasp", "films_held", "films_failed", "objects_made", "object_sizes", "nearest_pair"),
        *("success_vs_width", "promise_against_fact", "expected_against_trials", "robustness"),
    }
    files = {path.name for path in (report[0] / "figures").iterdir()}
    failed = {"failed_trial_1", "failed_trial_2"}  # pages as they are: pictures alone
    assert files == {f"{name}.{kind}" for name in names for kind in ("png", "pdf")} | {f"{name}.png" for name in failed}
    assert set(re.findall(r'<figure id="(\w+)"', html)) == names | failed


def test_the_page_is_well_formed_and_needs_nothing_else(html, parsed):
    assert parsed.misplaced == [] and parsed.open == []
    assert len(parsed.addresses) == 23
    assert all(address.startswith("data:image/png;base64,") for address in parsed.addresses)
    style = html.split("<style>")[1].split("</style>")[0]
    assert "url(" not in style and "@import" not in style and "<script" not in html
    assert "http:" not in html and "https:" not in html


def test_the_page_says_what_it_must(parsed, inputs):
    text = " ".join("".join(parsed.text).split())
    assert "made <up> & tiny" in text  # escaped, not interpreted
    assert "All 12 recordings were made by a simulated robot" in text
    for heading in ("σu, mm", "ρuv", "bias u, mm", "bias θ, °", "outliers"):
        assert heading in text
    row = inputs.robot_uncertainty.iloc[0]
    for key in ("estimated_u_mm", "bias_theta_deg"):  # each with its interval
        assert f"{row[key]:.1f} [{row[key + '_low']:.1f}, {row[key + '_high']:.1f}]" in text
    assert f"{row['condition']}" in text and "assumed" in row["condition"]
    assert "train objects left out: rolled away1" in text
    assert "Rejected becauseMeshes flat1" in text
    assert "madeCC0 & more33621" in text
    for parameter in inputs.parameters:
        assert parameter.key in text
    assert "compute.workers" not in text
    for i in range(2):  # the last condition's Best Grasp failed on both objects
        assert f"Why a trial failed: 1-{i}-BestGrasp.mcap, as its recording tells." in text
    assert "data/robot_failures has a page for each of the 2 trials of Table 2 that failed." in text
    assert "evaluate75.0 s" in text and f"label_grasps@test{page.DASH}" in text


def test_metrics_are_json_with_four_digits(report):
    numbers = json.loads((report[0] / "metrics.json").read_text())
    assert numbers["table1"]["all"]["fcn"]["robust_minus_best"]["value"] == 0.5
    assert numbers["table1"]["graspable"]["objects"] == numbers["objects"]["test"]["graspable"] == 1
    assert numbers["objects"]["test"]["left_out"] == {"rolled away": 1}
    assert numbers["objects"]["test"]["tried"] == 2
    assert results_sentence(numbers).startswith("On the 1 test object that can be held")
    assert numbers["table2"]["simulated_recordings"] == 12
    assert numbers["labels"]["attempts"] == 2 * 40151


def test_csv_reads_back(report):
    table = pd.read_csv(report[0] / "table2.csv")
    assert table["simulated"].all() and set(table["method"]) >= {"Best Grasp (fcn)", "Centroid"}
    series = pd.read_csv(report[0] / "success_vs_sigma_uv.csv")
    assert series["sigma_uv_mm"].tolist() == [5, 20] and series["best_grasp"].tolist() == [1, 0]
    dvc = yaml.safe_load((ROOT / "dvc.yaml").read_text())
    (plotted,) = (
        plot["y"]["reports/${scale}/success_vs_sigma_uv.csv"] for part in dvc["plots"] for plot in part.values()
    )
    assert ["sigma_uv_mm", *plotted] == list(series)


def test_robustness_is_a_table_for_people_and_for_machines(report, parsed):
    table = pd.read_csv(report[0] / "robustness.csv")
    assert list(table) == COLUMNS and len(table) == 2 * 3 * 3 + 2
    gone = table[(table["method"] == "Best Grasp") & (table["amount"] != 0) & ~table["table_fit"]]
    assert (gone[["success", "expected", "stay_share"]] == 0).all(axis=None) and (gone["expected_change"] == -0.5).all()
    kept = table[(table["network"] == "fcn") & table["table_fit"]]
    assert (kept[["success", "expected", "stay_share", "highest_score"]] == [0.5, 0.5, 1, 0.1]).all(axis=None)
    assert "For 4 of the 36 plans the image was refused" in (report[0] / "robustness.md").read_text()
    text = " ".join("".join(parsed.text).split())
    assert "offset +5 mm" in text and "Robustness (ours, not the paper's)" in text


def test_the_nearest_pair_across_the_split_is_drawn(inputs, report, monkeypatch):
    assert (report[0] / "figures/nearest_pair.png").exists()
    drawn = []
    monkeypatch.setattr(nearest, "picture", lambda mesh, *_: drawn.append(mesh.extents[2]) or np.zeros((2, 2, 3)))
    (plate,) = nearest.plates(inputs.data, inputs.manifests, inputs.placed)
    assert drawn == pytest.approx([0.03, 0.04])
    assert "made-box-test-1 is most like a training object, made-box-train-0. " in plate.caption
    assert "surfaces lie 1.2 % of its size apart on average; of the median test object and its nearest, 1.2 %." in (
        plate.caption
    )


def test_where_no_neighbour_came_to_rest_there_is_no_pair(inputs):
    lost = inputs.manifests["test"].assign(nearest="made-box-train-2")
    assert list(nearest.plates(inputs.data, dict(inputs.manifests) | {"test": lost}, inputs.placed)) == []


def test_figures_of_an_earlier_report_do_not_stay(inputs, report, monkeypatch, tmp_path):
    stale = tmp_path / "figures/old.png"
    stale.parent.mkdir()
    stale.write_bytes(b"")
    monkeypatch.setattr("graspfn.reporting.report.draw_all", lambda *_: iter(()))
    write_report(inputs, tmp_path)
    assert not stale.exists()


def test_without_a_film_the_other_scenes_are_still_drawn(inputs, monkeypatch):
    monkeypatch.setattr(shading, "SAMPLES", 1)
    bare = dataclasses.replace(inputs, film=None, films={"held": [], "failed": []})
    assert [plate.name for plate in registry._scenes(bare)] == ["object_sizes", "objects_made", "nearest_pair"]


def test_a_picture_is_its_own_bytes():
    assert Picture("a", "b", b"\x89PNG").source == "data:image/png;base64,iVBORw=="


def test_shown_objects_take_turns_over_the_classes():
    classes = pd.Series(["b", "b", "a", "c", "a"])
    assert spread(classes, 4) == [2, 0, 3, 4]
    assert spread(classes, 99) == [2, 0, 3, 4, 1]


def test_example_label_is_the_third_quartile():
    successes = np.zeros((5, *grid.SHAPE), dtype=np.uint8)
    for i, count in enumerate((40, 0, 10, 30, 20)):
        successes[i].flat[:count] = 1
    assert example_label(successes) == 3


@pytest.mark.parametrize(
    ("value", "said"), [(3.21, "3.2 s"), (600.0, "10.0 min"), (7200.0, "2.0 h"), (float("nan"), page.DASH)]
)
def test_durations_are_in_the_unit_people_would_use(value, said):
    assert page.seconds(value) == said


def test_recordings_without_a_grasp_reach_table_2_and_the_page(inputs, tmp_path):
    """One trial of each object and condition becomes one where nothing was found to try."""
    data = tmp_path / "data"
    shutil.copytree(inputs.data, data)
    for path in recordings(data / "recordings"):
        trial = read_trial(path, inputs.params.topics)
        if trial.condition.method == "Best Grasp":
            failed = dataclasses.replace(trial, commanded=None, achieved=None, success=False)
            write_trial(path, failed, inputs.params.topics, "32FC1")
    analyse_recordings(data, inputs.params)
    with_failures = load_inputs(data, inputs.params, {})
    assert all(len(grasp.commanded) == 3 for grasp in with_failures.recorded.grasps)
    tables1 = Tables1.of(with_failures.plans, with_failures.graspable, with_failures.test_source)
    layouts = write_tables(with_failures, tables1, robustness_table(with_failures.disturbed), tmp_path / "tables")
    (table2,) = [table for table in layouts if table.caption.startswith("Table 2.")]
    assert "In 4 of the 12 trials the method found no grasp, which is a failure." in table2.caption
    table = pd.read_csv(tmp_path / "tables/table2.csv")
    assert table.loc[table["method"] == "Best Grasp (fcn)", "success"].eq(0).all()
    assert table["no_grasp"].sum() == 4
