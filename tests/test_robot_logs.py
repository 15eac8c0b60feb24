"""`graspfn logs`: bags in, Table 2 and Sigma out, a line for each that cannot be used."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from made_bags import ARM as BY_TF
from made_bags import SAID, TOPICS, at, entries, write_mcap
from physics_params import PARAMS
from PIL import Image
from test_planning_planner import CAMERA, placed, seen
from test_robot_recording import CONDITION, trial
from typer.testing import CliRunner

from graspfn.cli import app
from graspfn.commands import logs as logs_command
from graspfn.geometry import grid
from graspfn.learning.networks import build_network
from graspfn.learning.weights import save_network
from graspfn.params import Arm
from graspfn.planning.covariance_file import read_covariance
from graspfn.reporting.failures import write_failures
from graspfn.robot import analyse as analyse_module
from graspfn.robot import messages, replan
from graspfn.robot.analyse import analyse
from graspfn.robot.read import recordings
from graspfn.robot.replan import Replanner

ARM = Arm("topic", "table", "up", "base_link", "tool", "x", None, 1, None)
KEPT = [TOPICS.depth, TOPICS.camera_info, TOPICS.commanded, TOPICS.outcome]
FEW = [entry for entry in entries() if entry[1] in KEPT and (entry[0] <= at(0.2) or entry[1] not in KEPT[:2])]


def bag(path, i, rng):
    q = np.array([0.05, -0.03, 0.7]) + rng.normal(size=3) * [0.006, 0.006, 0.08]
    pose = messages.pose_stamped(q, messages.header(at(3), "table"))
    method = ["Best Grasp", "Robust Best Grasp"][i % 2]
    said = SAID | {"placement": str(i), "method": method, "verdict": "held" if i % 3 else "failed"}
    return write_mcap(path, [*FEW, (at(3), TOPICS.achieved, "geometry_msgs/msg/PoseStamped", pose)], said)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Twenty bags, three of them bad in different ways; the parameters are those of the made bags."""
    rng = np.random.default_rng(1)
    there = tmp_path / "bags"
    there.mkdir()
    for i in range(17):
        bag(there / f"trial-{i}.mcap", i, rng)
    (there / "bad-text.mcap").write_text("FROM ros:jazzy")
    os.mkfifo(there / "bad-pipe.mcap")
    write_mcap(there / "bad-unsaid.mcap", FEW, None)
    made = dataclasses.replace(PARAMS, topics=TOPICS, arm=ARM)
    monkeypatch.setattr(logs_command, "read_yaml", lambda path: None)
    monkeypatch.setattr(logs_command, "validate", lambda values: made)
    return there


def test_twenty_bags_three_of_them_bad(folder, tmp_path):
    """One table, three lines, exit code 0."""
    result = CliRunner().invoke(app, ["logs", str(folder), "--out", str(tmp_path / "out")])
    assert result.exit_code == 0
    assert result.stderr.count("\n") == 3
    for line, name in zip(result.stderr.splitlines(), ("bad-pipe", "bad-text", "bad-unsaid"), strict=True):
        assert line.startswith(f"left out: {folder / name}.mcap: ")
    assert "All 17 recordings were made by a real robot" in result.stdout
    assert "6.2 mm, 4.7° assumed: 17 errors in 1 session" in result.stdout
    assert len(list((tmp_path / "out/failures").iterdir())) == 6
    names = ["covariance", "failures", "table2.csv", "table2.md", "trials.csv", "unused.csv"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names
    S = read_covariance(tmp_path / "out/covariance/6.2mm-4.7deg-assumed.yaml")
    assert 0.003 < np.sqrt(S[0, 0]) < 0.01


def test_json_is_json_and_paths_may_be_folders_and_bags(folder):
    result = CliRunner().invoke(app, ["logs", "--json", str(folder / "trial-0.mcap"), str(folder / "trial-1.mcap")])
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert [row["file"] for row in found["trials"]] == ["trial-0.mcap", "trial-1.mcap"]
    again = CliRunner().invoke(app, ["logs", "--json", str(folder), str(folder / "trial-1.mcap")])
    assert len(json.loads(again.stdout)["trials"]) == 17


def test_where_none_can_be_used_it_ends_in_one_line(folder, tmp_path):
    (tmp_path / "empty").mkdir()
    for given, says in (
        ([folder / "bad-text.mcap"], "1 of 1 bags cannot be used; the first: "),
        ([tmp_path / "none"], "none: no such file or folder"),
        ([tmp_path / "empty"], "no .mcap files"),
    ):
        result = CliRunner().invoke(app, ["logs", *map(str, given)])
        assert result.exit_code == 2 and result.stdout == ""
        assert len(result.stderr.splitlines()) == 1
        assert says in result.stderr


def test_bags_in_folders_of_a_folder_are_named_by_their_path(folder):
    """Two of one name in two sessions are two."""
    for session in ("monday", "tuesday"):
        (folder / session).mkdir()
        bag(folder / session / "trial-0.mcap", 40 + len(session), np.random.default_rng(len(session)))
    (folder / "tuesday" / "trials.csv").write_text("bag,session\ntrial-0.mcap,second day\n")
    result = CliRunner().invoke(app, ["logs", str(folder), "--json"])
    trials = json.loads(result.stdout)["trials"]
    assert len(trials) == 19
    sessions = {trial["file"]: trial["session"] for trial in trials}
    assert (sessions["monday/trial-0.mcap"], sessions["tuesday/trial-0.mcap"]) == ("", "second day")
    assert CliRunner().invoke(app, ["logs", str(folder / "monday")]).exit_code == 0


def test_a_changed_network_or_unit_shows_when_planned_again(folder, tmp_path):
    """The made bags command what no network planned."""
    torch.manual_seed(0)
    net = PARAMS.network["fcn"]
    save_network(tmp_path / "fcn", build_network(net), net)
    option = ["--network", f"fcn={tmp_path / 'fcn'}"]
    two = [str(folder / f"trial-{i}.mcap") for i in (0, 1)]
    result = CliRunner().invoke(app, ["logs", *two, *option, "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.stderr
    says = "trial-0.mcap: planned again, no grasp is found: camera: 0.40 m from the table 0.36 px see"
    assert says in result.stdout and not result.stderr
    with Image.open(tmp_path / "out/failures/trial-0.mcap.png") as page:
        assert page.width > 500
    for bad in ("fcn", f"fcn={tmp_path / 'none'}"):
        result = CliRunner().invoke(app, ["logs", str(folder), "--network", bad])
        assert result.exit_code == 2 and result.stderr.count("\n") == 1


def peak_at_the_object(offset_m, inputs):
    """A network's scores and classes: highest where the object is seen, and so far beside it along u."""
    rows, columns = np.nonzero(inputs[0, 0] > 0.1)  # of 100 mm
    v, u = np.mean([rows, columns], axis=1) * 0.0025 - [0.16375, 0.21875]
    poses = grid.poses()
    f = 0.9 * np.exp(-0.5 * ((poses[..., 0] - u - offset_m) ** 2 + (poses[..., 1] - v) ** 2) / 0.02**2)
    f *= np.cos(poses[..., 2] - 1) ** 2
    return f[None], np.rint(5 * f)[None].astype(np.uint8)


def test_a_plan_on_the_recorded_image_is_the_recorded_one_until_something_changes(monkeypatch):
    """The camera, its unit, the network; not by rounding to millimetres, nor where another pose is as good."""
    monkeypatch.setattr(replan, "_loaded", lambda folder: ("height_map", float(folder.name)))
    monkeypatch.setattr(replan, "predict_both", peak_at_the_object)
    sections = (PARAMS.plan, PARAMS.seed, PARAMS.camera, PARAMS.table, PARAMS.gripper)
    again, other = (Replanner.of({"fcn": Path(offset)}, *sections) for offset in ("0", "0.04"))
    exact = seen(CAMERA, placed((0.09, -0.06), 0.6)[0])
    for method in ("Best Grasp", "Best Grasp (likeliest class)", "Robust Best Grasp"):
        condition = dataclasses.replace(CONDITION, method=method, network="fcn")
        first = trial(condition=condition, depth=exact, camera_matrix=CAMERA.matrix)
        same = dataclasses.replace(first, commanded=again.replan(first).q)
        assert again.differs(same) == ""
        assert again.differs(dataclasses.replace(same, depth=np.round(exact, 3))) == ""
        assert "mm and" in again.differs(dataclasses.replace(same, camera_matrix=CAMERA.matrix * [[0.85], [0.85], [1]]))
        assert "planned again, the pose is 4" in other.differs(same)
        assert "no grasp is found: table: " in again.differs(dataclasses.replace(same, depth=10 * exact))
        assert again.differs(dataclasses.replace(same, commanded=None)) == "planned again, a grasp is found"
        assert Replanner.of({"alexnet": Path("0")}, *sections).differs(first) == ""
    monkeypatch.setattr(replan, "predict_both", lambda _, inputs: (np.full((1, *grid.SHAPE), 0.5),) * 2)
    assert again.differs(first) == ""


def test_the_number_of_processes_changes_nothing(folder, monkeypatch):
    bags = recordings(folder)
    monkeypatch.setattr(analyse_module, "WORTH_PROCESSES", 2)
    compute = dataclasses.replace(PARAMS.compute, workers=2)
    alone, shared = (analyse(bags, TOPICS, ARM, compute=one) for one in (None, compute))
    for name in ("trials", "uncertainty", "unused"):
        pd.testing.assert_frame_equal(getattr(alone, name), getattr(shared, name))
    assert len(alone.unused) == 3


def test_names_on_a_page_may_be_anything(folder, tmp_path):
    """No mathematics in them."""
    bag = write_mcap(folder / "$\\frac$_\\x.mcap", [
        (time, topic, kind, message | {"name": ["$\\frac$", "_b", "c"]} if topic == TOPICS.joints else message)
        for time, topic, kind, message in entries(held=False)
    ], SAID | {"object": "$\\left$", "placement": "x" * 300})  # fmt: skip
    arm = dataclasses.replace(BY_TF, achieved="columns", finger_joints=None)
    sidecar = "reached_u_mm: 50\nreached_v_mm: -30\nreached_theta_deg: 40\n"
    bag.with_name(f"{bag.name}.trial.yaml").write_text(sidecar)
    trials = analyse([bag], TOPICS, arm).trials
    assert write_failures(tmp_path, trials, folder, TOPICS, arm, {}, 100.0, None, None) == 1


@pytest.mark.parametrize(
    ("shut", "held", "judged", "says"),
    [
        (0.4, True, "held", ""),
        (0.4, False, "held", "the verdict is failed, but the fingers hold something up"),
        (0.6, False, "failed", ""),
    ],
)
def test_success_is_judged_from_fingers_and_lift_beside_the_verdict(tmp_path, shut, held, judged, says):
    """The fingers of the made bags meet at 0.6."""
    write_mcap(tmp_path / "a.mcap", entries(shut=shut, held=held))
    arm = dataclasses.replace(BY_TF, finger_shut=0.6)
    trials = analyse([tmp_path / "a.mcap"], TOPICS, arm).trials
    assert trials["judged"].tolist() == [judged]
    assert trials["success"].tolist() == [held]
    assert says in trials["flags"][0] and bool(says) == ("verdict" in trials["flags"][0])


def test_a_gripper_that_stays_down_holds_nothing_up(tmp_path):
    stays = [entry for entry in entries(shut=0.4) if entry[1] != TOPICS.tf or entry[0] <= at(3.9)]
    last = next(entry for entry in reversed(stays) if entry[1] == TOPICS.tf)
    moved = [(at(0.1 * i), TOPICS.tf, last[2], messages_at(last[3], at(0.1 * i))) for i in range(40, 60)]
    write_mcap(tmp_path / "a.mcap", sorted([*stays, *moved], key=lambda entry: entry[0]))
    trials = analyse([tmp_path / "a.mcap"], TOPICS, dataclasses.replace(BY_TF, finger_shut=0.6)).trials
    assert trials["judged"].tolist() == ["failed"]
    assert "the verdict is held, but the gripper rose by 0 mm alone" in trials["flags"][0]


def messages_at(message, time_ns):
    return {
        "transforms": [t | {"header": messages.header(time_ns, t["header"]["frame_id"])} for t in message["transforms"]]
    }
