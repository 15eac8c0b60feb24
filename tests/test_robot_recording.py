"""A trial written to MCAP and read back."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from graspfn.geometry.grid import angle_difference
from graspfn.geometry.transforms import T_world_grasp
from graspfn.params import Topics
from graspfn.robot.read import read_trial
from graspfn.robot.record import trial_bytes
from graspfn.robot.trial import REQUIRED, Condition, RecordingError, TrialRecording

TOPICS = Topics(
    "/camera/depth",
    "/camera/info",
    "/grasp/commanded",
    "/grasp/achieved",
    "/joints",
    "/grasp/held",
    "/tf",
    "/tf_static",
    None,
)
CONDITION = Condition("procedural-cup-0003", "2", "Robust Best Grasp", "alexnet", 6.2, 4.7, True)


def trial(seed: int = 0, **changes) -> TrialRecording:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.2, 0.42, (480, 640)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.05] = np.nan
    made = TrialRecording(
        condition=CONDITION,
        depth=depth,
        camera_matrix=np.array([[570.0, 0, 319.5], [0, 570.0, 239.5], [0, 0, 1]]),
        commanded=np.array([0.123, -0.045, 1.1]),
        achieved=np.array([0.119, -0.041, 1.2]),
        joint_names=("hand", "finger_left", "finger_right"),
        joint_time_s=np.arange(20) * 0.1,
        joint_positions=rng.random((20, 3)),
        success=True,
    )
    return dataclasses.replace(made, **changes)


def write_trial(path: Path, made: TrialRecording, topics: Topics, depth_encoding: str) -> None:
    path.write_bytes(trial_bytes(made, topics, depth_encoding))


def assert_same(a: TrialRecording, b: TrialRecording) -> None:
    """Everything but the depth image."""
    assert (a.condition, a.joint_names, a.success) == (b.condition, b.joint_names, b.success)
    np.testing.assert_array_equal(a.camera_matrix, b.camera_matrix)
    assert a.distortion == b.distortion
    np.testing.assert_array_equal(a.joint_positions, b.joint_positions)
    np.testing.assert_allclose(a.joint_time_s, b.joint_time_s, atol=1e-9)
    for p, q in ((a.commanded, b.commanded), (a.achieved, b.achieved)):
        np.testing.assert_array_equal(p[:2], q[:2])
        assert abs(angle_difference(p[2], q[2])) < 1e-12
        assert 0 <= q[2] < np.pi


@pytest.mark.parametrize("theta", [0.0, 1e-9, 1.2, np.pi / 2, np.pi - 1e-9])
@pytest.mark.parametrize("success", [True, False])
def test_metres_come_back_bit_for_bit(tmp_path, theta, success):
    made = trial(commanded=np.array([-0.2, 0.1, theta]), success=success)
    write_trial(tmp_path / "a.mcap", made, TOPICS, "32FC1")
    back = read_trial(tmp_path / "a.mcap", TOPICS)
    assert_same(made, back)
    np.testing.assert_array_equal(made.depth, back.depth)
    assert back.depth.dtype == np.float32


def test_millimetres_come_back_rounded_once(tmp_path):
    made = trial()
    write_trial(tmp_path / "a.mcap", made, TOPICS, "16UC1")
    back = read_trial(tmp_path / "a.mcap", TOPICS)
    assert_same(made, back)
    np.testing.assert_array_equal(np.isnan(made.depth), np.isnan(back.depth))
    assert np.nanmax(abs(made.depth - back.depth)) < 0.00051
    write_trial(tmp_path / "b.mcap", back, TOPICS, "16UC1")
    np.testing.assert_array_equal(back.depth, read_trial(tmp_path / "b.mcap", TOPICS).depth)


def test_the_bytes_depend_on_the_trial_alone(tmp_path):
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        write_trial(tmp_path / name, trial(seed), TOPICS, "16UC1")
    a, b, c = ((tmp_path / name).read_bytes() for name in "abc")
    assert a == b != c


def test_joint_series_of_different_lengths_are_refused():
    with pytest.raises(ValueError):
        trial_bytes(trial(joint_time_s=np.arange(3.0)), TOPICS, "16UC1")


@pytest.mark.parametrize("count", [0, 5, 8])
def test_the_lens_comes_back(tmp_path, count):
    made = trial(distortion=tuple(0.1 * (i + 1) for i in range(count)))
    write_trial(tmp_path / "a.mcap", made, TOPICS, "16UC1")
    assert_same(made, read_trial(tmp_path / "a.mcap", TOPICS))


def test_a_trial_without_joint_states(tmp_path):
    made = trial(joint_names=(), joint_time_s=np.zeros(0), joint_positions=np.zeros((0, 0)))
    write_trial(tmp_path / "a.mcap", made, TOPICS, "16UC1")
    assert_same(made, read_trial(tmp_path / "a.mcap", TOPICS))


def test_the_file_is_what_ros_tools_expect(tmp_path):
    write_trial(tmp_path / "a.mcap", trial(), TOPICS, "16UC1")
    with (tmp_path / "a.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        kinds = {c.topic: (summary.schemas[c.schema_id].name, c.message_encoding) for c in summary.channels.values()}
        assert kinds[TOPICS.depth] == ("sensor_msgs/msg/Image", "cdr")
        written = ("depth", "camera_info", "commanded", "achieved", "joints", "outcome")
        assert set(kinds) == {getattr(TOPICS, key) for key in written}
        assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
        times = [message.log_time for _, _, message in reader.iter_messages(log_time_order=False)]
        assert times == sorted(times)
        assert [m.metadata["simulated"] for m in reader.iter_metadata()] == ["true"]


def test_recorded_poses_are_the_gripper_frame_of_the_geometry(tmp_path):
    from scipy.spatial.transform import Rotation

    from graspfn.robot.messages import header, pose_stamped

    q = np.array([0.1, -0.05, 2.2])
    message = pose_stamped(q, header(0, "table"))["pose"]
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat([message["orientation"][k] for k in "xyzw"]).as_matrix()
    T[:3, 3] = [message["position"][k] for k in "xyz"]
    np.testing.assert_allclose(T, T_world_grasp(q), atol=1e-12)


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("method", "Best", "Robust Best Grasp"),
        ("simulated", "yes", "true nor false"),
        ("sigma_uv_mm", "wide", "mm"),
        ("sigma_uv_mm", "nan", "mm"),
        ("sigma_theta_deg", "-3", "degrees"),
    ],
)
def test_impossible_metadata_is_named(key, value, says):
    with pytest.raises(RecordingError, match=says) as error:
        Condition.from_metadata(CONDITION.to_metadata() | {key: value})
    assert key in str(error.value)


def test_metadata_round_trip_and_missing_keys():
    assert Condition.from_metadata(CONDITION.to_metadata()) == CONDITION
    for key in REQUIRED:
        text = CONDITION.to_metadata()
        del text[key]
        with pytest.raises(RecordingError, match=key):
            Condition.from_metadata(text)
