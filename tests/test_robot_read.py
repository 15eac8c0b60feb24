"""Recordings that others wrote: padding, byte order, videos, orientations, damage."""

from __future__ import annotations

import re
import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer
from scipy.spatial.transform import Rotation
from test_robot_recording import CONDITION, TOPICS, trial, write_trial

from graspfn.robot import decode, messages
from graspfn.robot.read import read_trial, recordings
from graspfn.robot.trial import METADATA, RecordingError

REAL = Path(__file__).parents[1] / "../shared/data/mcap"
needs_real_files = pytest.mark.skipif(not REAL.is_dir(), reason="the real recordings are not beside the repository")


def others(path: Path, order=None, metadata=True, **counts) -> Path:
    """A recording as another program might write it: any order in the file, depth images as a video."""
    frame = messages.header(0, "table")
    made = trial()
    entries = []
    for i in range(counts.get("depth", 3)):
        image = messages.depth_image(np.full((4, 6), 0.1 * (i + 1), np.float32), "32FC1", frame)
        image |= counts.get("image", {})
        entries.append((10 * i, TOPICS.depth, "sensor_msgs/msg/Image", image))
    late = messages.depth_image(np.full((4, 6), 9.0, np.float32), "32FC1", frame)
    entries.append((200, TOPICS.depth, "sensor_msgs/msg/Image", late))
    info = messages.camera_info(np.eye(3), (4, 6), frame) | counts.get("info", {})
    entries.append((5, TOPICS.camera_info, "sensor_msgs/msg/CameraInfo", info))
    for topic, q in ((TOPICS.commanded, made.commanded), (TOPICS.achieved, made.achieved)):
        for i in range(counts.get(topic, 1)):
            pose = messages.pose_stamped(q, frame)
            entries.append((100 + i, topic, "geometry_msgs/msg/PoseStamped", pose))
    for i in range(counts.get("outcome", 1)):
        entries.append((300 + i, TOPICS.outcome, "std_msgs/msg/Bool", {"data": True}))
    entries.append((150, "/rosout", "std_msgs/msg/Bool", {"data": False}))
    if order is not None:
        entries = [entries[i] for i in order.permutation(len(entries))]
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE)  # as rosbag2 does by default
        schemas = {name: writer.register_msgdef(name, text) for name, text in messages.SCHEMAS.items()}
        for time, topic, kind, message in entries:
            if topic not in counts.get("without", ()):
                writer.write_message(topic, schemas[counts.get("kind", {}).get(topic, kind)], message, log_time=time)
        if metadata:
            writer.add_metadata(METADATA, CONDITION.to_metadata())
        writer.finish()
    return path


@pytest.mark.parametrize("seed", range(4))
def test_the_last_image_before_the_command_is_taken_in_any_order(tmp_path, seed):
    back = read_trial(others(tmp_path / "a.mcap", np.random.default_rng(seed)), TOPICS)
    np.testing.assert_allclose(back.depth, 0.3, rtol=1e-6)
    np.testing.assert_allclose(back.commanded, trial().commanded)
    np.testing.assert_allclose(back.achieved, trial().achieved)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (
            {"metadata": False},
            "no metadata record 'graspfn.trial', no bag.mcap.trial.yaml, no line of trials.csv; .*sigma_uv_mm",
        ),
        ({"without": (TOPICS.achieved,)}, f"no message on topic {TOPICS.achieved}"),
        ({"without": (TOPICS.outcome,)}, f"no message on topic {TOPICS.outcome}"),
        ({"without": (TOPICS.depth,)}, f"no message on topic {TOPICS.depth}"),
        ({"without": (TOPICS.camera_info,)}, f"no message on topic {TOPICS.camera_info}"),
        ({"depth": 0}, f"{TOPICS.depth} before the commanded pose"),
        ({TOPICS.commanded: 2}, f"2 messages on topic {TOPICS.commanded}"),
        ({"kind": {TOPICS.outcome: "sensor_msgs/msg/JointState"}}, "carries sensor_msgs/msg/JointState; it takes std"),
    ],
)
def test_what_is_missing_is_said_in_one_line_with_the_file(tmp_path, changes, says):
    path = others(tmp_path / "bag.mcap", **changes)
    with pytest.raises(RecordingError, match=says) as error:
        read_trial(path, TOPICS)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


def image(depth_m: np.ndarray, encoding: str, big: bool, padding: int) -> SimpleNamespace:
    kind = (">" if big else "<") + ("u2" if encoding == "16UC1" else "f4")
    pixels = (depth_m * 1000).round().astype(kind) if encoding == "16UC1" else depth_m.astype(kind)
    rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(depth_m), -1)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=255)
    return SimpleNamespace(
        encoding=encoding, is_bigendian=int(big), height=depth_m.shape[0], width=depth_m.shape[1],
        step=rows.shape[1], data=rows.tobytes(),
    )  # fmt: skip


@pytest.mark.parametrize("encoding", ["16UC1", "32FC1"])
@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("padding", [0, 3, 8])
def test_byte_order_and_row_padding_do_not_show(encoding, big, padding):
    depth = np.random.default_rng(0).integers(200, 500, (5, 7)).astype(np.float32) / 1000
    np.testing.assert_allclose(decode.depth(image(depth, encoding, big, padding)), depth, rtol=1e-6)


@pytest.mark.parametrize("invalid", [0.0, -0.0, np.nan, np.inf, -np.inf, -1.0])
def test_every_way_of_saying_no_measurement_becomes_nan(invalid):
    depth = decode.depth(image(np.array([[0.4, invalid]]), "32FC1", False, 0))
    np.testing.assert_array_equal(depth, np.array([[0.4, np.nan]], dtype=np.float32))


@pytest.mark.parametrize("encoding", ["16UC1", "mono16"])
@pytest.mark.parametrize("invalid", [0.0, 65.535])
def test_both_ends_of_16_bits_are_no_measurement(encoding, invalid):
    message = image(np.array([[0.4, invalid, 65.534]]), "16UC1", False, 0)
    message.encoding = encoding
    np.testing.assert_allclose(decode.depth(message), [[0.4, np.nan, 65.534]], rtol=1e-6)


def test_what_16_bits_do_not_hold_is_written_as_no_measurement():
    depth = np.array([[0.4, np.nan, np.inf, -np.inf, -1.0, 0.0, 65.534, 65.535, 1e6]], np.float32)
    message = SimpleNamespace(**messages.depth_image(depth, "16UC1", {}))
    assert np.frombuffer(message.data, "<u2").tolist() == [400, 0, 0, 0, 0, 0, 65534, 0, 0]


@pytest.mark.parametrize(
    ("changes", "topic", "says"),
    [
        ({"image": {"data": bytes(96)}}, "depth", "without a single measurement"),
        ({"image": {"data": np.full(24, np.nan, "<f4").tobytes()}}, "depth", "without a single measurement"),
        ({"image": {"data": b"\xff" * 48, "encoding": "16UC1", "step": 12}}, "depth", "without a single measurement"),
        ({"image": {"height": 0, "width": 0, "step": 0, "data": b""}}, "depth", "0 rows of 0 pixels"),
        ({"image": {"height": 0}}, "depth", "0 rows of 6 pixels"),
        ({"image": {"width": 0}}, "depth", "4 rows of 0 pixels"),
        ({"image": {"step": 23}}, "depth", "does not fit its 96 bytes"),
        ({"image": {"step": 2**32 - 1}}, "depth", "does not fit its 96 bytes"),
        ({"image": {"height": 2**32 - 1}}, "depth", "does not fit its 96 bytes"),
        ({"image": {"data": bytes(95)}}, "depth", "does not fit its 95 bytes"),
        ({"image": {"encoding": "bgr8"}}, "depth", "encoding 'bgr8'; it takes 16UC1"),
        ({"image": {"encoding": ""}}, "depth", "encoding ''"),
        ({"image": {"height": 2}}, "camera_info", "of 6x4 pixels; the depth image has 6x2"),
        ({"info": {"height": 0, "width": 0}}, "camera_info", "of 0x0 pixels; the depth image has 6x4"),
        ({"info": {"height": 480, "width": 640}}, "camera_info", "of 640x480 pixels"),
        ({"info": {"binning_x": 2}}, "camera_info", "of 3x4 pixels"),
        ({"info": {"k": [0.0] * 9}}, "camera_info", "focal lengths above 0"),
        ({"info": {"k": [-570.0, 0, 3, 0, 570, 2, 0, 0, 1]}}, "camera_info", "focal lengths above 0"),
        ({"info": {"k": [np.nan] * 9}}, "camera_info", "focal lengths above 0"),
    ],
)
def test_an_image_that_nothing_could_be_planned_on_is_refused_with_its_topic(tmp_path, changes, topic, says):
    path = others(tmp_path / "bag.mcap", **changes)
    with pytest.raises(RecordingError, match=re.escape(says)) as error:
        read_trial(path, TOPICS)
    assert str(error.value).startswith(f"{path}: topic {getattr(TOPICS, topic)}: ")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("shape", [(1, 6), (4, 1), (1, 1)])
def test_an_image_of_one_row_or_column_is_an_image(tmp_path, shape):
    small = messages.depth_image(np.full(shape, 0.4, np.float32), "32FC1", messages.header(0, ""))
    info = {"height": shape[0], "width": shape[1]}
    assert read_trial(others(tmp_path / "a.mcap", image=small, info=info), TOPICS).depth.shape == shape


def test_the_camera_matrix_is_of_the_image_and_not_of_the_whole_sensor(tmp_path):
    """A point seen at pixel p of the sensor is at (p - offset) / bins of an image of a binned region."""
    roi = {"x_offset": 100, "y_offset": 60, "height": 8, "width": 18, "do_rectify": False}
    K = np.array([[570.0, 0, 319.5], [0, 560.0, 239.5], [0, 0, 1]])
    info = {"height": 480, "width": 640, "k": K.ravel().tolist(), "roi": roi, "binning_x": 3, "binning_y": 2}
    found = read_trial(others(tmp_path / "a.mcap", info=info), TOPICS).camera_matrix
    point = np.array([0.01, -0.02, 0.4])
    sensor, seen = K @ point / 0.4, found @ point / 0.4
    np.testing.assert_allclose(seen[:2], (sensor[:2] - [100, 60]) / [3, 2])


def test_a_lens_of_another_model_is_not_taken_for_ours(tmp_path):
    """Its four numbers would be read as others."""
    info = {"d": [0.1, 0.01, 0.0, 0.0], "distortion_model": "equidistant"}
    with pytest.raises(RecordingError, match=r"camera/info: distortion_model 'equidistant'; it takes plumb_bob"):
        read_trial(others(tmp_path / "a.mcap", info=info), TOPICS)


def test_images_that_cannot_be_depth_are_refused():
    good = image(np.ones((4, 4)), "16UC1", False, 0)
    for change in ({"encoding": "rgb8"}, {"step": 7}, {"data": good.data[:-1]}, {"height": 5}):
        with pytest.raises(RecordingError):
            decode.depth(SimpleNamespace(**(vars(good) | change)))


def stamped(rotation: Rotation, frame: str = "table", scale: float = 1.0, metres: float = 1.0) -> SimpleNamespace:
    x, y, z, w = scale * rotation.as_quat()
    orientation = SimpleNamespace(x=x, y=y, z=z, w=w)
    position = SimpleNamespace(x=0.1 * metres, y=-0.2 * metres, z=0.05)
    pose = SimpleNamespace(position=position, orientation=orientation)
    return SimpleNamespace(header=SimpleNamespace(frame_id=frame), pose=pose)


@pytest.mark.parametrize("theta", np.linspace(-4, 4, 9))
def test_theta_is_the_direction_of_closing_however_the_quaternion_says_it(theta):
    """Both signs of a quaternion, either end of the jaw, a tool frame that points down, an imperfect length."""
    about_z = Rotation.from_euler("z", -theta)
    down, half_turn = Rotation.from_euler("x", np.pi), Rotation.from_euler("z", np.pi)
    for message in (
        stamped(about_z),
        stamped(about_z, scale=-1.001),
        stamped(about_z * half_turn),
        stamped(about_z * down, "/table"),
        stamped(about_z * Rotation.from_euler("y", 0.2)),
    ):
        u, v, found = decode.pose(message)
        assert (u, v) == (0.1, 0.2)
        assert abs((found - theta + np.pi / 2) % np.pi - np.pi / 2) < 1e-9
        assert 0 <= found < np.pi


@pytest.mark.parametrize(
    ("message", "says"),
    [
        (stamped(Rotation.identity(), "base_link"), "frame 'base_link'"),
        (stamped(Rotation.from_euler("y", np.pi / 2)), "off the table"),
        (stamped(Rotation.identity(), scale=0.0), "quaternion"),
        (stamped(Rotation.identity(), scale=np.nan), "quaternion"),
        (stamped(Rotation.identity(), metres=1000), "223.607 m from the image centre; it takes metres"),
        (stamped(Rotation.identity(), metres=np.nan), "position is not finite"),
    ],
)
def test_poses_that_are_no_grasp_are_refused(message, says):
    with pytest.raises(RecordingError, match=says):
        decode.pose(message)


def test_joint_states_of_several_publishers_are_one_series():
    first = SimpleNamespace(name=["a", "b"], position=[1.0, 2.0])
    second = SimpleNamespace(name=["c", "b"], position=[3.0, 4.0])
    names, time_s, positions = decode.joints([(1_500_000_000, first), (2_000_000_000, second)], 1_000_000_000)
    assert names == ("a", "b", "c")
    np.testing.assert_allclose(time_s, [0.5, 1.0])
    np.testing.assert_array_equal(positions, [[1, 2, np.nan], [np.nan, 4, 3]])


def test_damage_anywhere_is_an_error_or_harmless(tmp_path):
    """Bytes flipped or cut at random: never another exception, never a different trial without one."""
    whole = others(tmp_path / "whole.mcap").read_bytes()
    good = read_trial(tmp_path / "whole.mcap", TOPICS)
    path, rng, refused = tmp_path / "bad.mcap", np.random.default_rng(0), 0
    for i in range(150):
        bad = bytearray(whole)
        if i % 3 == 0:
            del bad[int(rng.integers(len(bad))) :]
        else:
            at = int(rng.integers(len(bad)))
            bad[at] ^= int(rng.integers(1, 256))
        path.write_bytes(bad)
        try:
            back = read_trial(path, TOPICS)
        except RecordingError as error:
            refused += 1
            assert str(error).startswith(f"{path}: ") and "\n" not in str(error)
        else:
            np.testing.assert_array_equal(back.depth, good.depth)
            np.testing.assert_array_equal(back.achieved, good.achieved)
    assert refused > 75


def test_files_that_are_no_recording(tmp_path):
    (tmp_path / "text.mcap").write_text("FROM ros:jazzy\n")
    (tmp_path / "empty.mcap").write_bytes(b"")
    for name, says in (("text.mcap", "not an MCAP"), ("empty.mcap", "not an MCAP"), ("none.mcap", "cannot be read")):
        with pytest.raises(RecordingError, match=f"{name}: {says}"):
            read_trial(tmp_path / name, TOPICS)


def test_recordings_of_a_folder(tmp_path):
    with pytest.raises(RecordingError, match=r"no \.mcap files"):
        recordings(tmp_path)
    for name in ("b.mcap", "a.mcap", "notes.txt", ".a.mcap.12.part"):
        (tmp_path / name).touch()
    assert [path.name for path in recordings(tmp_path)] == ["a.mcap", "b.mcap"]


@needs_real_files
def test_real_files_that_hold_no_trial():
    for name, says in (
        ("Dockerfile.mcap", "not an MCAP file"),
        ("test_sample_truncated.mcap", "no metadata record.*cut short: read up to byte"),
        ("test_sample.mcap", "no metadata record 'graspfn.trial'"),
    ):
        with pytest.raises(RecordingError, match=says):
            read_trial(REAL / name, TOPICS)


@needs_real_files
@pytest.mark.parametrize("kind", sorted(messages.SCHEMAS))
def test_our_definitions_read_what_ros_wrote_as_its_own_do(kind):
    """Messages of a real ROS 2 file, decoded with its schema and with ours."""
    ours = DecoderFactory()
    seen = 0
    with (REAL / "ros2_common_types.mcap").open("rb") as stream:
        for schema, channel, message, theirs in make_reader(
            stream, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            if schema.name != kind:
                continue
            own = SimpleNamespace(id=schema.id, name=kind, encoding="ros2msg", data=messages.SCHEMAS[kind].encode())
            assert repr(ours.decoder_for(channel.message_encoding, own)(message.data)) == repr(theirs)
            seen += 1
    assert seen > 0


def test_pixels_never_pass_through_python_one_by_one(tmp_path):
    """A list of its bytes alone would be 10 MB; the image is 1.2 MB, and lies in memory a few times at once."""
    write_trial(tmp_path / "a.mcap", trial(), TOPICS, "32FC1")
    tracemalloc.start()
    read_trial(tmp_path / "a.mcap", TOPICS)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 7e6
