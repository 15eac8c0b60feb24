"""`graspfn logs`: bags in, Table 2 and Sigma out, a line for each that cannot be used."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest
from made_bags import SAID, TOPICS, at, entries, write_mcap
from typer.testing import CliRunner

from graspfn import cli
from graspfn.cli import app
from graspfn.params import Arm
from graspfn.robot import messages
from graspfn.robot.covariance_file import read_covariance

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
    made = type("Made", (), {"topics": TOPICS, "arm": ARM})
    monkeypatch.setattr(cli, "read_yaml", lambda path: None)
    monkeypatch.setattr(cli, "validate", lambda values: made)
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
    names = ["covariance", "table2.csv", "table2.md", "trials.csv", "unused.csv"]
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
    for given, says in (
        ([folder / "bad-text.mcap"], "1 of 1 bags cannot be used; the first: "),
        ([tmp_path / "none"], "none: no such file or folder"),
        ([tmp_path], "none|no .mcap files"),
    ):
        result = CliRunner().invoke(app, ["logs", *map(str, given)])
        assert result.exit_code == 2 and result.stdout == ""
        assert len(result.stderr.splitlines()) == 1
        assert any(one in result.stderr for one in says.split("|"))
