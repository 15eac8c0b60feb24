"""Methods that find no grasp: a failed trial in both tables, and a recording that says so."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pandas as pd
import physics_params
import pytest
from test_robot_recording import TOPICS, trial, write_trial

from graspfn.evaluation.bench import Scene
from graspfn.evaluation.planner import GraspFunction, Planner
from graspfn.evaluation.trials import NO_GRASP, trials_of_object
from graspfn.geometry import grid
from graspfn.imaging.camera import Camera
from graspfn.imaging.height_map import height_map
from graspfn.params import Plan
from graspfn.physics.attempt import Outcome, Result
from graspfn.physics.world import Rig
from graspfn.planning.uncertainty import PlanningError, PoseUncertainty
from graspfn.reporting import tables
from graspfn.reporting.plans import plans_of
from graspfn.robot import simulated
from graspfn.robot.analyse import analyse
from graspfn.robot.read import read_trial
from graspfn.robot.simulated import Seen, file_name
from graspfn.robot.trial import METADATA, RecordingError
from graspfn.workflow.files import write_parquet

CAMERA = Camera.of_the_paper(640, 480, 570.0)
PLAN = Plan(fine_uv=1, fine_theta=1)
EMPTY = np.full((480, 640), CAMERA.table_depth, np.float32)
CELLS = [(5.0, 10.0), (20.0, 10.0)]
PLANNER, SCENE = Planner(PLAN, 0), Scene("a", height_map(EMPTY, CAMERA), np.zeros(2), 0.0)
POSES = ["u_m", "v_m", "theta_rad", "reached_u_m", "reached_v_m", "reached_theta_rad"]


class SureBench:
    """Every grasp that is tried holds."""

    def __init__(self, *_):
        self.tried = 0

    def grasp(self, *_, **__):
        self.tried += 1
        return Result(Outcome.HELD)


def functions():
    """One network that knows a grasp, and one that finds none."""
    good = np.zeros(grid.SHAPE, np.float32)
    good[16, 20:24, 3] = 0.9
    return [GraspFunction("good", 0, good), GraspFunction("none", 0, np.zeros(grid.SHAPE, np.float32))]


def plans(functions):
    return PLANNER.plans(SCENE, functions, [PoseUncertainty.of(*cell) for cell in CELLS])


def test_trials_without_a_grasp_fail_and_try_nothing(tmp_path):
    bench = SureBench()
    rows = pd.DataFrame(trials_of_object(SCENE, bench, PLANNER, functions(), CELLS, np.zeros((1, 3)), None))
    assert len(rows) == 2 * 5 and bench.tried == 2 * 2
    without = rows["network"] != "good"  # over an empty table Centroid finds none either
    assert (rows.loc[without, "outcome"] == NO_GRASP).all() and not rows.loc[without, "success"].any()
    assert rows.loc[without, POSES].isna().all(axis=None)
    assert rows.loc[~without, "success"].all() and rows.loc[~without, POSES].notna().all(axis=None)
    write_parquet(tmp_path / "trials.parquet", rows)
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "trials.parquet"), rows)

    table = tables.table1(plans_of(rows), frozenset())
    for line in table.to_dict("records"):
        found = line["network"] == "good"
        assert (line["success"], line["trials"], line["no_grasp"]) == ((1.0, 1, 0) if found else (0.0, 1, 1))
    assert "In 6 of the 10 trials the method found no grasp, which is a failure." in tables.caption1(table, "made")
    assert "no grasp" not in tables.caption1(tables.table1(plans_of(rows[~without]), frozenset()), "made")


def test_a_function_of_nan_is_a_fault_and_not_a_trial():
    with pytest.raises(PlanningError):
        plans([GraspFunction("broken", 0, np.full(grid.SHAPE, np.nan, np.float32))])


def no_grasp(**changes):
    joints = {"joint_names": (), "joint_time_s": np.zeros(0), "joint_positions": np.zeros((0, 0))}
    return dataclasses.replace(trial(), commanded=None, achieved=None, success=False, **joints, **changes)


def test_a_recording_without_a_grasp_comes_back(tmp_path):
    write_trial(tmp_path / "a.mcap", no_grasp(), TOPICS, "32FC1")
    back = read_trial(tmp_path / "a.mcap", TOPICS)
    assert back.commanded is None and back.achieved is None and not back.success
    assert back.condition == no_grasp().condition
    np.testing.assert_array_equal(back.depth, no_grasp().depth)


def test_the_simulated_robot_records_what_it_could_not_try(tmp_path, monkeypatch):
    sure = SimpleNamespace(run=lambda q, whole, film: Result(Outcome.HELD))
    monkeypatch.setattr(simulated, "Grasper", lambda resting, rig: sure)
    rig = Rig(physics_params.PHYSICS, physics_params.GRIPPER, physics_params.ATTEMPT)
    for made in simulated.record(Seen("a", 0, EMPTY, SCENE), CELLS, plans(functions()), None, rig, CAMERA, 0):
        write_trial(tmp_path / file_name(made.condition), made, TOPICS, "16UC1")
    done = analyse(tmp_path.glob("*.mcap"), TOPICS)
    trials, found = done.trials, done.uncertainty
    assert len(trials) == 10
    assert trials["u_m"].isna().sum() == 6 and trials[POSES].isna().all(axis=1).sum() == 6
    assert trials.loc[trials["u_m"].isna(), "network"].isin(["", "none"]).all()
    assert (trials["success"] == trials["u_m"].notna()).all()
    assert (found["trials"] == 5).all() and (found["draws"] == 1).all()  # two methods, one error

    table = tables.table2(trials)
    assert table["no_grasp"].tolist() == [int("good" not in method) for method in table["method"]]
    assert "In 6 of the 10 trials the method found no grasp" in tables.caption2(table, trials, "made")


def test_recordings_without_a_grasp_say_nothing_about_the_arm(tmp_path):
    write_trial(tmp_path / "a.mcap", no_grasp(), TOPICS, "16UC1")
    done = analyse([tmp_path / "a.mcap"], TOPICS)
    trials = done.trials
    (line,) = done.uncertainty.to_dict("records")
    assert (line["trials"], line["draws"]) == (1, 0)
    assert (line["estimated_uv_mm_low"], line["estimated_uv_mm_high"]) == (0, np.inf)
    assert all(np.isnan(line[f"{key}"]) for key in ("estimated_uv_mm", "estimated_theta_deg", "bias_u_mm"))
    assert not trials["success"].any()


@pytest.mark.parametrize(
    ("made", "metadata", "says"),
    [
        (trial(), {"planned": "false"}, r"1 message on topic /grasp/commanded, but planned: false"),
        (no_grasp(), {"planned": "true"}, r"no message on topic /grasp/commanded; a trial has exactly one"),
        (no_grasp(), {"planned": "no"}, "planned: 'no' is neither true nor false"),
        (dataclasses.replace(no_grasp(), success=True), {}, "/grasp/held: a success, but planned: false"),
    ],
)
def test_recordings_that_contradict_themselves_are_one_line(tmp_path, monkeypatch, made, metadata, says):
    from mcap.writer import Writer

    path, write = tmp_path / "a.mcap", Writer.add_metadata
    monkeypatch.setattr(Writer, "add_metadata", lambda self, name, data: write(self, name, data | metadata))
    write_trial(path, made, TOPICS, "16UC1")
    with pytest.raises(RecordingError, match=says) as caught:
        read_trial(path, TOPICS)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


def test_metadata_of_a_trial_that_had_a_grasp_are_as_ever(tmp_path):
    from mcap.reader import make_reader

    write_trial(tmp_path / "a.mcap", trial(), TOPICS, "16UC1")
    with (tmp_path / "a.mcap").open("rb") as stream:
        (record,) = make_reader(stream).iter_metadata()
    assert record.name == METADATA and record.metadata == trial().condition.to_metadata()
