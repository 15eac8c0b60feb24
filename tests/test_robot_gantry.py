"""The simulated arm, and that its recordings are what a real one's would be: read by TF as well as by PoseStamped."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh
from mcap.reader import make_reader
from physics_params import ATTEMPT, GRIPPER, JAW, PARAMS, PHYSICS
from test_robot_recording import CONDITION, TOPICS

from graspfn.evaluation.planner import Planned
from graspfn.geometry.grid import angle_difference
from graspfn.geometry.transforms import T_world_grasp, translation
from graspfn.imaging.camera import Camera
from graspfn.meshes.placed import Resting
from graspfn.params import Arm
from graspfn.physics.world import Rig
from graspfn.robot import gantry
from graspfn.robot.analyse import analyse
from graspfn.robot.gantry import ARRIVED_S, FINGER_JOINTS, JOINTS, T_BASE_TABLE, Gantry
from graspfn.robot.read import read_trial
from graspfn.robot.record import command_ns, trial_bytes
from graspfn.robot.simulated import Seen, record
from graspfn.robot.source import source_of
from graspfn.robot.trial import RecordingError

CAMERA = Camera.from_params(PARAMS.camera)
BAR = trimesh.creation.box([0.03, 0.14, 0.04])
RESTING = Resting(BAR, BAR, translation(0, 0, 0.02))
Q = np.array([0.03, -0.02, 2.9])
BY_TF = Arm("tf", "table", "up", "base_link", "gripper", "x", FINGER_JOINTS, 1, None)
SOFTWARE = {"graspfn": "1", "fcn_sha256": "00"}


def arm(gripper=GRIPPER) -> Gantry:
    return Gantry(CAMERA, gripper)


@pytest.fixture(scope="module")
def trials():
    """held, missed, blocked and unplanned trials on a bar, the arm without error."""
    scene = SimpleNamespace(unmoved=lambda q: q)
    depth = np.full((480, 640), CAMERA.table_depth, np.float32)
    plans = {"held": (0.0, 0.0, 0.0), "missed": (0.2, 0.1, 1.0), "blocked": (0.0, 0.0, np.pi / 2), "unplanned": None}
    planned = [Planned("Best Grasp", name, 0, None if q is None else np.array(q)) for name, q in plans.items()]
    rig = Rig(PHYSICS, GRIPPER, ATTEMPT)
    made = record(Seen("bar", 0, depth, scene), [(0.0, 0.0)], [planned], RESTING, rig, CAMERA, 0)
    return dict(zip(plans, made, strict=True))


def written(tmp_path, trial, name="a.mcap", topics=TOPICS):
    (tmp_path / name).write_bytes(trial_bytes(trial, topics, "16UC1", arm(), SOFTWARE))
    return tmp_path / name


@pytest.mark.parametrize("gripper", [GRIPPER, JAW])
def test_frames_are_those_of_the_gripper_and_its_pose(gripper):
    made = arm(gripper)
    opened, closed = made.kinematics.open, made.kinematics.closed
    positions = np.array([*made.over(Q, 0.12), opened, closed])
    T = {child: (parent, T) for parent, child, T in [*made.fixed, *made.transforms(positions)]}

    def T_base(frame):
        return np.eye(4) if frame == gantry.BASE else T_base(T[frame][0]) @ T[frame][1]

    T_table_gripper = np.linalg.inv(T_BASE_TABLE) @ T_base("gripper")
    np.testing.assert_allclose(T_table_gripper, T_world_grasp(Q) @ translation(0, 0, 0.12), atol=1e-12)
    for side, position, name in ((-1, opened, "finger_left_link"), (1, closed, "finger_right_link")):
        np.testing.assert_allclose(T[name][1], made.kinematics.finger(side, position), atol=1e-12)


def test_it_looks_from_where_its_camera_is():
    made = arm()
    T = {child: T for _, child, T in [*made.fixed, *made.transforms(made.waits().positions[0])]}
    T_base_flange = T["bridge"] @ T["carriage"] @ T["column"] @ T["flange"]
    T_table_camera = np.linalg.inv(T_BASE_TABLE) @ T_base_flange @ T[gantry.CAMERA]
    np.testing.assert_allclose(T_table_camera, CAMERA.T_world_camera, atol=1e-12)


def test_the_description_names_every_joint_and_says_simulated():
    robot = ElementTree.fromstring(arm().urdf())
    assert "simulated" in robot.attrib["name"]
    joints = {joint.attrib["name"]: joint for joint in robot.iter("joint")}
    assert set(JOINTS) < set(joints)
    children = [joint.find("child").attrib["link"] for joint in joints.values()]
    assert sorted([*children, gantry.BASE]) == sorted(link.attrib["name"] for link in robot.iter("link"))


def test_success_and_every_failure_are_recorded_to_the_end(trials):
    fates = {name: trial.success for name, trial in trials.items()}
    assert fates == {"held": True, "missed": False, "blocked": False, "unplanned": False}
    top = {name: trial.joint_positions[:, 2].max() for name, trial in trials.items()}
    for name in ("held", "missed"):
        one = trials[name]
        assert one.joint_positions[-1, 2] - one.joint_positions[:, 2].min() == pytest.approx(ATTEMPT.lift_mm / 1e3)
        assert one.joint_time_s[-1] > ARRIVED_S + ATTEMPT.close_s + ATTEMPT.lift_mm / ATTEMPT.lift_speed_mms
    blocked = trials["blocked"]
    assert np.ptp(blocked.joint_positions[:, 4:]) == 0
    assert arm().over(Q, 0)[2] < blocked.joint_positions[-1, 2] < top["blocked"]
    assert np.ptp(trials["unplanned"].joint_positions, axis=0).max() == 0
    for trial in trials.values():
        assert trial.joint_names == JOINTS
        assert (np.diff(trial.joint_time_s) > 1e-3).all()
        assert abs(np.diff(trial.joint_positions[:, :3], axis=0)).max() < 0.025  # a metre a second


def test_a_trial_reads_alike_by_tf_and_by_pose(tmp_path, trials):
    for shift in np.random.default_rng(0).normal(size=(5, 3)) * [0.01, 0.01, 0.3]:
        reached = Q + shift
        frames = [SimpleNamespace(time_s=0.01 * i, hand_z=0.0, fingers=(0.01 * i,) * 2) for i in range(40)]
        moves = arm().grasps(reached, 0.0, frames)
        trial = dataclasses.replace(
            trials["held"], commanded=Q, achieved=reached, joint_time_s=moves.time_s, joint_positions=moves.positions
        )
        path = written(tmp_path, trial)
        by_pose, by_tf = read_trial(path, TOPICS), read_trial(path, TOPICS, BY_TF)
        np.testing.assert_array_equal(by_pose.achieved[:2], reached[:2])
        np.testing.assert_allclose(by_tf.achieved[:2], reached[:2], atol=1e-9)
        assert abs(angle_difference(by_tf.achieved[2], by_pose.achieved[2])) < 1e-9
        np.testing.assert_allclose(by_tf.joint_time_s, trial.joint_time_s, atol=1e-9)
        looked = read_trial(path, TOPICS, dataclasses.replace(BY_TF, table_frame=None))  # by hand-eye alone
        np.testing.assert_allclose(looked.achieved[:2], reached[:2], atol=0.001)
        assert (by_pose.flags, by_pose.doubts, by_tf.doubts) == ((), (), ())


def test_an_arm_stopped_on_its_way_is_a_failure_of_table_2_and_no_error_of_sigma(tmp_path, trials):
    for name, trial in trials.items():
        written(tmp_path, trial, f"{name}.mcap")
    found = analyse(tmp_path.glob("*.mcap"), TOPICS, BY_TF)
    assert found.unused.empty
    assert found.trials["success"].sum() == 1
    doubts = found.trials.set_index("file")["doubts"]
    assert "never closed" in doubts["blocked.mcap"]
    assert found.uncertainty["draws"].sum() == 1  # held and missed, by the same error


def test_fingers_and_lift_say_what_the_simulation_does(tmp_path, trials):
    fingers = dataclasses.replace(BY_TF, finger_shut=arm().kinematics.closed)
    for name in ("held", "missed", "blocked"):
        back = read_trial(written(tmp_path, trials[name]), TOPICS, fingers)
        assert back.judged is trials[name].success and back.flags == ()


def test_the_workflow_judges_its_trials_as_graspfn_logs_judges_anyones(tmp_path, trials):
    for name, trial in trials.items():
        written(tmp_path, trial, f"{name}.mcap")
    _, own = source_of(PARAMS.robot, PARAMS.arm, GRIPPER)
    found = analyse(tmp_path.glob("*.mcap"), TOPICS, own).trials.set_index("file")
    assert found["judged"].to_dict() == {
        "held.mcap": "held", "missed.mcap": "failed", "blocked.mcap": "failed", "unplanned.mcap": ""
    }  # fmt: skip
    assert found["why"].to_dict() == {
        "held.mcap": "", "missed.mcap": "fingers shut on nothing", "blocked.mcap": "the fingers never closed",
        "unplanned.mcap": "no grasp was found to try",
    }  # fmt: skip
    by_tf = analyse(tmp_path.glob("*.mcap"), TOPICS, dataclasses.replace(BY_TF, finger_shut=own.finger_shut))
    assert by_tf.trials.set_index("file")["why"].to_dict() == found["why"].to_dict()
    assert by_tf.reasons().startswith(
        "3 of 4 trials failed: 1 fingers shut on nothing, 1 no grasp was found to try, 1 "
    )


def test_a_simulated_verdict_is_no_slip_of_a_hand(tmp_path, trials):
    """What held is as thin as paper; of a real robot nobody believes it."""
    own = dataclasses.replace(BY_TF, finger_shut=arm().kinematics.closed)
    thin = dataclasses.replace(trials["missed"], success=True)
    assert "shut on nothing" in read_trial(written(tmp_path, thin), TOPICS, own).flags[0]
    real = dataclasses.replace(thin, condition=dataclasses.replace(thin.condition, simulated=False))
    with pytest.raises(RecordingError, match="shut on nothing"):
        read_trial(written(tmp_path, real), TOPICS, own)


def test_every_channel_says_what_rosbag2_would(tmp_path, trials):
    rosbags = pytest.importorskip("rosbags.typesys", reason="rosbags of requirements.lock is not installed")
    store = rosbags.get_typestore(rosbags.Stores.ROS2_JAZZY)
    path = written(tmp_path, trials["held"])
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    topics = {channel.topic for channel in summary.channels.values()}
    assert {TOPICS.tf, TOPICS.tf_static, "/robot_description", TOPICS.joints, TOPICS.camera_info} < topics
    for channel in summary.channels.values():
        kind = summary.schemas[channel.schema_id].name
        assert channel.metadata["topic_type_hash"] == store.hash_rihs01(kind)
        latched = channel.topic in (TOPICS.tf_static, "/robot_description")
        assert ("transient_local" in channel.metadata["offered_qos_profiles"]) == latched


def test_rosbags_opens_a_whole_trial_and_decodes_every_message(tmp_path, trials):
    highlevel = pytest.importorskip("rosbags.highlevel", reason="rosbags of requirements.lock is not installed")
    one = trials["held"]
    with highlevel.AnyReader([written(tmp_path, one)]) as reader:
        read = [reader.deserialize(raw, connection.msgtype).__msgtype__ for connection, _, raw in reader.messages()]
    assert read.count("tf2_msgs/msg/TFMessage") == len(one.joint_time_s) + 1
    assert len(read) == 2 * len(one.joint_time_s) + 7


def test_no_two_messages_of_a_topic_and_no_two_trials_share_their_time(tmp_path, trials):
    with written(tmp_path, trials["held"]).open("rb") as stream:
        reader = make_reader(stream)
        times = [(channel.topic, message.log_time) for _, channel, message in reader.iter_messages()]
        assert len(set(times)) == len(times)
        assert {record.name: record.metadata.get("simulated") for record in reader.iter_metadata()} == {
            "graspfn.trial": "true",
            "graspfn.software": "true",
        }
        assert "simulated" in reader.get_header().library
    conditions = [dataclasses.replace(CONDITION, placement=str(i)) for i in range(200)]
    assert len({command_ns(condition) for condition in conditions}) == 200


def test_the_foxglove_layout_shows_what_is_recorded():
    """Its topics and frames are those of the simulated robot as conf/robot names them."""
    text = (Path(__file__).parents[1] / "docs/foxglove_layout.json").read_text()
    layout = json.loads(text)
    topics = {*vars(PARAMS.topics).values(), "/robot_description"}
    assert set(re.findall(r'"(/[a-z_/]+)', text)) <= topics
    view = layout["configById"]["3D!trial"]
    assert {view["followTf"], view["layers"]["grid"]["frameId"]} <= {"base_link", "table"}
    for path in layout["configById"]["Plot!joints"]["paths"]:
        assert JOINTS[int(re.findall(r"\d+", path["value"])[0])] in ("arm_z", *FINGER_JOINTS)
