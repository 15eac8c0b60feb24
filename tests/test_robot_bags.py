"""Bags as rosbag2 leaves them: their forms, who says what the trial was, where the gripper was."""

from __future__ import annotations

import dataclasses
import io
import struct
from types import SimpleNamespace

import numpy as np
import pytest
import zstandard
from made_bags import (
    ACHIEVED,
    ARM,
    CLOSE_S,
    COMMANDED,
    ENCODERS,
    SAID,
    SHUT_S,
    T_BASE_TABLE,
    TOPICS,
    arm,
    at,
    entries,
    transform,
    write_mcap,
)
from mcap.writer import CompressionType
from PIL import Image
from test_robot_recording import TOPICS as SIMULATED_TOPICS
from test_robot_recording import trial, write_trial
from typer.testing import CliRunner

from graspfn.cli import app
from graspfn.geometry.grid import angle_difference
from graspfn.geometry.transforms import T_world_grasp
from graspfn.imaging.camera import straight_down
from graspfn.planning.target import T_robot_target
from graspfn.robot import decode, messages
from graspfn.robot.analyse import analyse
from graspfn.robot.closing import closing_s
from graspfn.robot.described import describe, read_table, sidecar
from graspfn.robot.read import read_trial, recordings
from graspfn.robot.target import target_in_image
from graspfn.robot.trial import KEYS, RecordingError

rosbags = pytest.importorskip("rosbags", reason="rosbags of requirements.lock is not installed: make setup")


def write_rosbag(folder, found, storage="MCAP", mode="NONE"):
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    writer = Writer(folder, version=9, storage_plugin=StoragePlugin[storage])
    if mode != "NONE":
        writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for time, topic, kind, message in found:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], time, bytes(ENCODERS[kind](message)))
    return folder


def assert_read(back, flags=None):
    np.testing.assert_allclose(back.commanded, COMMANDED)
    np.testing.assert_allclose(back.achieved, ACHIEVED, atol=1e-9)
    np.testing.assert_allclose(back.depth, 0.4, atol=1e-6)
    assert back.success and back.doubts == () and (flags is None or back.flags == flags)
    assert back.condition.object == "cup" and not back.condition.simulated


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
@pytest.mark.parametrize("mode", ["NONE", "FILE", "MESSAGE"])
def test_a_bag_in_every_form_of_rosbag2_is_the_same_trial(tmp_path, storage, mode):
    if (storage, mode) == ("MCAP", "MESSAGE"):
        pytest.skip("rosbags writes compressed messages into .db3 alone")
    bag = write_rosbag(tmp_path / "bag", entries(), storage, mode)
    describe(bag, SAID)
    assert recordings(tmp_path) == [bag]
    assert_read(read_trial(bag, TOPICS, ARM))
    (part,) = [file for file in bag.iterdir() if "metadata" not in file.name]
    describe(part, SAID)
    assert_read(read_trial(part, TOPICS, ARM))


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("index", [True, False])
@pytest.mark.parametrize("chunks", [True, False])
def test_an_mcap_with_or_without_chunks_index_and_compression(tmp_path, compression, index, chunks):
    path = write_mcap(tmp_path / "a.mcap", entries(), index=index, compression=compression, use_chunking=chunks)
    flags = () if chunks else ("no checksums: damage would not show",)
    assert_read(read_trial(path, TOPICS, ARM), flags)
    packed = tmp_path / "b.mcap.zstd"
    packed.write_bytes(zstandard.compress(path.read_bytes()))
    assert_read(read_trial(packed, TOPICS, ARM), flags)


def test_a_checksum_of_the_whole_is_as_good_as_one_of_each_chunk(tmp_path):
    options = {"use_chunking": False, "enable_data_crcs": True}
    path = write_mcap(tmp_path / "a.mcap", entries(), **options)
    assert_read(read_trial(path, TOPICS, ARM), ())
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="damaged: the checksum of its data is another"):
        read_trial(path, TOPICS, ARM)


def test_messages_compressed_one_by_one(tmp_path, monkeypatch):
    import made_bags

    packed = {kind: lambda m, encode=encode: zstandard.compress(encode(m)) for kind, encode in ENCODERS.items()}
    monkeypatch.setattr(made_bags, "ENCODERS", packed)
    assert_read(read_trial(write_mcap(tmp_path / "a.mcap", entries()), TOPICS, ARM))


def test_the_parts_of_a_split_bag_are_one_and_a_missing_one_is_named(tmp_path):
    found, bag = entries(), tmp_path / "bag"
    bag.mkdir()
    third = len(found) // 3
    for i in range(3):
        write_mcap(bag / f"bag_{i}.mcap", found[i * third : (i + 1) * third if i < 2 else None], None)
    names = "".join(f"    - bag_{i}.mcap\n" for i in range(3))
    (bag / "metadata.yaml").write_text(f"rosbag2_bagfile_information:\n  relative_file_paths:\n{names}")
    describe(bag, SAID)
    assert_read(read_trial(bag, TOPICS, ARM))
    (bag / "bag_1.mcap").unlink()
    with pytest.raises(RecordingError, match=r"its part 'bag_1.mcap', which metadata.yaml names, is not in the folder"):
        read_trial(bag, TOPICS, ARM)
    (bag / "metadata.yaml").unlink()  # the recorder was killed: nobody knows of the part
    with pytest.raises(RecordingError, match=r"a gap of 2\.0 s as the fingers begin to close"):
        read_trial(bag, TOPICS, ARM)


def test_a_file_cut_short_is_read_up_to_the_cut(tmp_path):
    whole = write_mcap(tmp_path / "a.mcap", entries(), None, chunk_size=20_000).read_bytes()
    describe(tmp_path / "a.mcap", SAID)
    flagged = 0
    for share in (0.97, 0.95, 0.93, 0.9, 0.8, 0.3):
        (tmp_path / "a.mcap").write_bytes(whole[: int(share * len(whole))])
        try:
            back = read_trial(tmp_path / "a.mcap", TOPICS, ARM)
        except RecordingError as error:
            assert "cut short: read up to byte" in str(error)
        else:
            assert_read(back)
            flagged += all(flag.startswith("cut short: read up to byte") for flag in back.flags) and len(back.flags)
    assert flagged >= 2


def test_what_the_trial_was_comes_from_the_bag_its_sidecar_or_the_table(tmp_path):
    """Of each key from the first of them that has it."""
    path = write_mcap(tmp_path / "a.mcap", entries(), {"object": "cup"})
    (tmp_path / "trials.csv").write_text("bag,object,placement,method,network,verdict\na.mcap,jug,7,Centroid,,\n")
    sidecar(path).write_text("object: jar\nplacement: 02\nsigma_uv_mm: 1e1\nsigma_theta_deg: 5\nsimulated: false\n")
    back = read_trial(path, TOPICS, ARM, read_table(tmp_path)[path])
    c = back.condition
    assert (c.object, c.placement, c.method, c.network, c.sigma_uv_mm) == ("cup", "02", "Centroid", "", 10)
    assert back.success
    describe(path, {"verdict": "failed", "injected_uv_mm": "20", "injected_theta_deg": "15", "session": "tuesday"})
    back = read_trial(path, TOPICS, ARM, read_table(tmp_path)[path])
    assert not back.success
    assert (back.condition.injected_uv_mm, back.condition.session) == (20, "tuesday")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("object: [a, b]", "takes lines of key: value"),
        ("{", "not YAML"),
        ("colour: red", "colour: no such key"),
        ("method: Best", "method: 'Best' is not one of"),
        ("sigma_uv_mm: -1", "sigma_uv_mm: '-1' is not std"),
        ("sigma_uv_mm: .nan", "sigma_uv_mm: '.nan' is not"),
        ("verdict: yes", "neither held nor failed"),
        ("u_mm: 3", "has u_mm alone; it takes all of u_mm, v_mm, theta_deg"),
        ("injected_uv_mm: 3", "one of injected_uv_mm and injected_theta_deg"),
        ("a: &a [x]\nb: *a", "takes lines of key: value"),
        ("[" * 5000, "not YAML"),
    ],
)
def test_a_sidecar_that_says_nothing_sensible_is_one_line(tmp_path, text, says):
    found = [entry for entry in entries() if entry[1] != TOPICS.commanded]
    path = write_mcap(tmp_path / "a.mcap", found)
    sidecar(path).write_text(text)
    with pytest.raises(RecordingError, match=says) as error:
        read_trial(path, TOPICS, ARM)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("object\ncup\n", "line 2 has no 'bag'"),
        ("bag,object\na,b\na,c\n", "line 3 is the second of a"),
        ("bag,object\na\n", "line 2 has not as many cells"),
        ("bag,object\na,b,c\n", "line 2 has not as many cells"),
        ('bag,object\na,"b\n', "not CSV"),
    ],
)
def test_a_table_that_cannot_be_read_is_one_line(tmp_path, text, says):
    (tmp_path / "trials.csv").write_text(text)
    with pytest.raises(RecordingError, match=says):
        read_table(tmp_path)


def test_a_line_of_the_table_without_a_bag_is_named(tmp_path):
    write_mcap(tmp_path / "a.mcap", entries())
    (tmp_path / "trials.csv").write_text("bag,session\na.mcap,1\nb.mcap,1\n")
    done = analyse(recordings(tmp_path), TOPICS, ARM, read_table(tmp_path))
    assert done.unused["file"].tolist() == ["b.mcap"] and len(done.trials) == 1


def test_the_command_writes_the_sidecar_and_says_what_is_missing(tmp_path):
    path = write_mcap(tmp_path / "a.mcap", entries(), {"object": "cup"})
    result = CliRunner().invoke(app, ["trial", str(path), "placement=3", "object=jug", "network="])
    assert result.exit_code == 0
    assert "placement: 3" in result.output and "object: the bag itself says 'cup'" in result.output
    assert "still missing: method, sigma_uv_mm, sigma_theta_deg, simulated" in result.output
    for arguments, says in ((["colour=red"], "colour: no such key"), (["method"], "method: takes KEY=VALUE")):
        result = CliRunner().invoke(app, ["trial", str(path), *arguments])
        assert result.exit_code == 2 and says in result.output
    result = CliRunner().invoke(app, ["trial", str(path), "placement="])
    assert sidecar(path).read_text() == "object: jug\nnetwork: ''\n"


def test_every_key_of_what_a_trial_was_is_documented():
    text = (__import__("pathlib").Path(__file__).parents[1] / "docs/recordings.md").read_text()
    assert [key for key in KEYS if f"`{key}`" not in text] == []


# Where the gripper was


def test_the_fingers_close_after_they_opened():
    time = np.linspace(0, 6, 601)
    way = np.interp(time, [0, 1.2, 1.6, 3, 3.5], [0.3, 0.3, 0.1, 0.1, 0.6])
    noise = np.random.default_rng(0).normal(0, 0.002, time.shape)
    for sign in (1, -1):
        found = closing_s(time, sign * (way + noise)[:, None], sign)
        assert found == pytest.approx(3.0, abs=0.06)
    gaps = np.where(np.arange(601) % 2, np.nan, way)[:, None]
    assert closing_s(time, gaps, 1) == pytest.approx(3.0, abs=0.06)
    again = np.interp(time, [0, 3, 3.3, 4, 4.3, 5, 6], [0.1, 0.1, 0.35, 0.35, 0.1, 0.1, 0.8])  # lets go again
    assert closing_s(time, again[:, None], 1) == pytest.approx(3.0, abs=0.06)
    assert closing_s(time, np.full((601, 1), 0.1), 1) is None
    assert closing_s(time[:0], np.zeros((0, 1)), 1) is None


def without(*topics):
    return [entry for entry in entries() if entry[1] not in topics]


def before_the_command(found):
    """Without the images after it, which show another table."""
    return [entry for entry in found if entry[1] != TOPICS.depth or entry[0] <= at(1)]


def gripper_command(seconds):
    return [(at(seconds), "/gripper/command", "std_msgs/msg/Bool", {"data": True})]


def test_the_pose_reached_is_that_of_the_moment_the_fingers_close(tmp_path):
    """Whether joints tell it or a command; in whatever frame the pose was commanded; by a tracker as by TF."""
    path = write_mcap(tmp_path / "a.mcap", entries())
    assert_read(read_trial(path, TOPICS, ARM))
    path = write_mcap(
        tmp_path / "b.mcap", sorted([*entries(), *gripper_command(0.5), *gripper_command(3.2)], key=lambda e: e[0])
    )
    by_command = dataclasses.replace(TOPICS, gripper="/gripper/command")
    assert_read(read_trial(path, by_command, arm(finger_joints=None)))
    in_base = messages.pose_stamped(COMMANDED, messages.header(at(1), "base_link"))
    T = T_BASE_TABLE @ T_world_grasp(COMMANDED)
    moved = transform(1, "", "", T)["transform"]
    in_base["pose"] = {"position": moved["translation"], "orientation": moved["rotation"]}
    found = [*without(TOPICS.commanded), (at(1), TOPICS.commanded, "geometry_msgs/msg/PoseStamped", in_base)]
    assert_read(read_trial(write_mcap(tmp_path / "c.mcap", found), TOPICS, ARM))
    tracked = []
    for i in range(50):
        q = ACHIEVED if 20 <= i <= 35 else np.add(ACHIEVED, [0.1, 0, 0])
        pose = messages.pose_stamped(q, messages.header(at(0.1 * i), "table"))
        tracked.append((at(0.1 * i), TOPICS.achieved, "geometry_msgs/msg/PoseStamped", pose))
    path = write_mcap(tmp_path / "d.mcap", [*entries(), *tracked])
    assert_read(read_trial(path, TOPICS, arm(achieved="topic")))
    path = write_mcap(tmp_path / "e.mcap", entries(), SAID | {
        "reached_u_mm": "53", "reached_v_mm": "-27", "reached_theta_deg": repr(float(np.degrees(0.72)))
    })  # fmt: skip
    assert_read(read_trial(path, TOPICS, arm(achieved="columns")))


def test_a_table_frame_that_looks_down_is_the_same_table(tmp_path):
    flip = np.diag([1.0, -1, -1, 1])
    static = transform(0, "base_link", "table", T_BASE_TABLE @ flip)
    found = [*without(TOPICS.tf_static, TOPICS.commanded),
             (at(0), TOPICS.tf_static, "tf2_msgs/msg/TFMessage", {"transforms": [static]})]  # fmt: skip
    said = SAID | {"u_mm": "50", "v_mm": "-30", "theta_deg": repr(float(np.degrees(0.7)))}
    assert_read(
        read_trial(write_mcap(tmp_path / "a.mcap", before_the_command(found), said), TOPICS, arm(table_z="down"))
    )


def test_without_a_frame_of_the_table_the_image_shows_where_it_is(tmp_path):
    """The camera is fixed to the base here, looking straight down at a table 0.4 m away."""
    said = SAID | {"u_mm": "50", "v_mm": "-30", "theta_deg": repr(float(np.degrees(0.7)))}
    path = write_mcap(tmp_path / "a.mcap", before_the_command(without(TOPICS.commanded)), said)
    back = read_trial(path, TOPICS, arm(table_frame=None))
    np.testing.assert_allclose(back.achieved, ACHIEVED, atol=1e-4)


def static(*transforms):
    return [(at(0), TOPICS.tf_static, "tf2_msgs/msg/TFMessage", {"transforms": list(transforms)})]


@pytest.mark.parametrize(
    ("found", "changes", "says"),
    [
        (without(), {"gripper_frame": "hand"}, "no frame 'hand' in TF within 0.6 s .*; there are base_link"),
        (without(TOPICS.tf), {}, "no frame 'tool' in TF"),
        (without(TOPICS.tf_static), {}, "no frame 'table' in TF"),
        (
            without(TOPICS.tf_static) + static(transform(0, "map", "table", T_BASE_TABLE)),
            {},
            "TF does not connect 'table' with 'tool'",
        ),
        (
            without(TOPICS.tf_static)
            + static(transform(0, "a", "table", np.eye(4)), transform(0, "table", "a", np.eye(4))),
            {},
            "TF runs in a circle",
        ),
        ([e for e in entries() if e[1] != TOPICS.tf or e[0] < at(2.7)], {}, "TF of 'tool' ends 0.3 s from the moment"),
        ([e for e in entries() if e[1] != TOPICS.tf or e[0] < at(2)], {}, "no frame 'tool' in TF within 0.6 s"),
        ([e for e in entries() if e[1] != TOPICS.tf or not at(2.5) < e[0] < at(3.3)], {}, "TF of 'tool' has a gap"),
        (without(), {"finger_joints": ("thumb",)}, "no joint thumb; there are wrist, finger_1, finger_2"),
        (without(), {"finger_joints": ("wrist",), "finger_sign": -1}, "wrist never closed"),
        (without(TOPICS.joints), {}, "no joint finger_1, finger_2"),
        (without(), {"closing_axis": "z"}, "z axis is more than 60 degrees off the table"),
        (without(), {"finger_shut": 0.6}, "the fingers are shut on nothing"),
    ],
)  # fmt: skip
def test_what_tf_and_the_fingers_do_not_say_is_told(tmp_path, found, changes, says):
    path = write_mcap(tmp_path / "a.mcap", found)
    with pytest.raises(RecordingError, match=says) as error:
        read_trial(path, TOPICS, arm(**changes))
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)


def test_a_quarrel_about_a_frame_matters_to_who_asks_for_it(tmp_path):
    quarrel = static(transform(0, "a", "light", np.eye(4)), transform(0, "b", "light", np.eye(4)))
    assert_read(read_trial(write_mcap(tmp_path / "a.mcap", entries() + quarrel), TOPICS, ARM))
    with pytest.raises(RecordingError, match="frame 'light' hangs from both 'a' and 'b'"):
        read_trial(tmp_path / "a.mcap", TOPICS, arm(gripper_frame="light"))


def test_the_clock_of_the_arm_may_not_be_that_of_the_recorder(tmp_path):
    """It is an hour ahead, as the transforms and joints have it."""
    hour = 3600 * 10**9
    moved = []
    for time, topic, kind, message in entries():
        if topic == TOPICS.tf:
            (one,) = message["transforms"]
            stamp = messages.header(time - 2000 + hour, "base_link")
            message = {"transforms": [one | {"header": stamp}]}
        elif topic in (TOPICS.commanded, TOPICS.depth):
            message = message | {"header": messages.header(0, message["header"]["frame_id"])}
        moved.append((time, topic, kind, message))
    assert_read(read_trial(write_mcap(tmp_path / "a.mcap", moved), TOPICS, ARM))


def test_a_folder_of_many_trials_is_no_bag(tmp_path):
    """However they are called, but for the parts of one."""
    for name in ("monday/a.mcap", "tuesday/tuesday_0.mcap", "wednesday/wednesday_0.mcap", "wednesday/b.mcap"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    found = [path.relative_to(tmp_path).as_posix() for path in recordings(tmp_path)]
    assert found == ["monday/a.mcap", "tuesday", "wednesday/b.mcap", "wednesday/wednesday_0.mcap"]


def test_clocks_that_jump_and_orders_that_cannot_be_are_doubts(tmp_path):
    late = [e for e in entries() if e[1] == TOPICS.joints][300:]
    jumped = [(t, topic, kind, m | {"header": messages.header(t + 5 * 10**9, "")}) for t, topic, kind, m in late]
    kept = [e for e in entries() if e[1] != TOPICS.joints or e[0] < late[0][0]]
    path = write_mcap(tmp_path / "a.mcap", sorted([*kept, *jumped], key=lambda e: e[0]))
    assert "a clock jumps by 5 s" in read_trial(path, TOPICS, ARM).doubts[0]
    path = write_mcap(tmp_path / "b.mcap", [*entries(), *[e for e in entries() if e[1] == TOPICS.tf]])
    assert "the recorder's clock goes back by" in read_trial(path, TOPICS, ARM).doubts[0]
    early = [(at(0), TOPICS.outcome, "std_msgs/msg/Bool", {"data": True})]
    path = write_mcap(tmp_path / "c.mcap", without(TOPICS.outcome) + early)
    with pytest.raises(RecordingError, match="the verdict comes before the commanded pose"):
        read_trial(path, TOPICS, ARM)
    for seconds, says in ((0.5, "0.5 s before the command"), (5.5, "0.5 s after the verdict")):
        pose = messages.pose_stamped(ACHIEVED, messages.header(at(seconds), "table"))
        reached = [(at(seconds), TOPICS.achieved, "geometry_msgs/msg/PoseStamped", pose)]
        path = write_mcap(tmp_path / "d.mcap", entries() + reached)
        assert says in read_trial(path, TOPICS, arm(achieved="topic")).doubts[0]


def test_the_last_press_of_the_verdict_counts(tmp_path):
    again = [(at(5.5), TOPICS.outcome, "std_msgs/msg/Bool", {"data": False})]
    back = read_trial(write_mcap(tmp_path / "a.mcap", entries() + again), TOPICS, ARM)
    assert not back.success and "the verdict changed" in back.flags[-1]
    path = write_mcap(tmp_path / "b.mcap", without(TOPICS.outcome), SAID | {"verdict": "held"})
    assert_read(read_trial(path, TOPICS, ARM))


def test_between_two_transforms_a_frame_turns_evenly():
    """Half of the way and half of the turn in half of the time; a static one below it goes along."""
    from scipy.spatial.transform import Rotation

    from graspfn.robot.tf import Frames

    turned = np.eye(4)
    turned[:3, :3], turned[:3, 3] = Rotation.from_rotvec([0, 0, 1.0]).as_matrix(), [0.2, 0, 0.4]
    hand = np.eye(4)
    hand[:3, 3] = 0, 0.1, 0

    def message(*transforms):
        def plain(value):
            return SimpleNamespace(**{k: plain(v) for k, v in value.items()}) if isinstance(value, dict) else value

        return at(0), SimpleNamespace(transforms=[plain(one) for one in transforms])

    moving = [message(transform(0.4, "base", "arm", turned), transform(0, "base", "arm", np.eye(4)))]
    frames = Frames(moving, [message(transform(0, "arm", "hand", hand))])
    found = frames.lookup("base", "hand", at(0.1))
    np.testing.assert_allclose(Rotation.from_matrix(found[:3, :3]).as_rotvec(), [0, 0, 0.25], atol=1e-9)
    np.testing.assert_allclose(found[:3, 3], [0.05 - 0.1 * np.sin(0.25), 0.1 * np.cos(0.25), 0.1], atol=1e-9)
    np.testing.assert_allclose(frames.lookup("hand", "base", at(0.1)) @ found, np.eye(4), atol=1e-12)


def random_pose(rng):
    T = np.eye(4)
    from scipy.spatial.transform import Rotation

    T[:3, :3], T[:3, 3] = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix(), rng.normal(size=3)
    return T


@pytest.mark.parametrize("seed", range(10))
def test_a_target_in_the_image_becomes_a_pose_of_the_robot_and_comes_back(seed):
    """T_RP = T_RG T_GC T_CI p, whatever the three are."""
    rng = np.random.default_rng(seed)
    T_RG, T_GC, T_CI = random_pose(rng), random_pose(rng), np.linalg.inv(straight_down(0.4))
    q = np.array([*rng.uniform(-0.2, 0.2, 2), rng.uniform(0, np.pi)])
    T_RP = T_robot_target(T_RG, T_GC, T_CI, q)
    back = target_in_image(np.linalg.inv(T_RG @ T_GC @ T_CI) @ T_RP)
    np.testing.assert_allclose(back[:2], q[:2], atol=1e-12)
    assert abs(angle_difference(back[2], q[2])) < 1e-12
    # The slow way: the target's point goes through the frames one by one.
    point = np.array([q[0], -q[1], 0, 1])
    np.testing.assert_allclose(T_RP[:, 3], T_RG @ (T_GC @ (T_CI @ point)), atol=1e-12)


# Depth as cameras publish it


def png(raw: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(raw.astype(np.uint16)).save(stream, format="PNG")
    return stream.getvalue()


def compressed(fmt: str, payload: bytes, a: float = 0, b: float = 0) -> SimpleNamespace:
    return SimpleNamespace(format=fmt, data=struct.pack("<Iff", 0, a, b) + payload)


@pytest.mark.parametrize("fmt", ["16UC1; compressedDepth", "16UC1; compressedDepth png", "; compressedDepth"])
def test_compressed_millimetres(fmt):
    raw = np.array([[400, 0, 65535], [1234, 399, 401]])
    found = decode.depth(compressed(fmt, png(raw)))
    np.testing.assert_allclose(found, [[0.4, np.nan, np.nan], [1.234, 0.399, 0.401]], rtol=1e-6)


def test_compressed_metres_are_an_inverse_of_the_depth():
    """As compressed_depth_image_transport quantises: q = A / depth + B."""
    depth = np.array([[0.4, 0.5, np.nan], [1.2, 0.41, 2.0]])
    a, b = 100.0 * 101, 1 - 100.0 * 101 / 10
    raw = np.where(np.isnan(depth), 0, np.rint(a / np.nan_to_num(depth, nan=1) + b))
    found = decode.depth(compressed("32FC1; compressedDepth png", png(raw), a, b))
    np.testing.assert_allclose(found, depth, rtol=1e-3)


@pytest.mark.parametrize(
    ("message", "says"),
    [
        (compressed("16UC1; compressedDepth rvl", b""), "RVL"),
        (compressed("bgr8; jpeg compressed bgr8", b""), "compressed image of format"),
        (compressed("16UC1; compressedDepth png", b""), "damaged PNG"),
        (compressed("16UC1; compressedDepth png", png(np.full((9, 9), 400))[:50]), "damaged PNG"),
        (compressed("16UC1; compressedDepth png", png(np.zeros((9, 9)))), "without a single measurement"),
    ],
)
def test_compressed_images_that_cannot_be_depth(message, says):
    with pytest.raises(RecordingError, match=says):
        decode.depth(message)


def test_a_compressed_image_in_a_bag(tmp_path):
    found = []
    for time, topic, kind, message in entries():
        if topic == TOPICS.depth:
            raw = np.frombuffer(message["data"], "<u2").reshape(48, 64)
            data = compressed("", png(raw)).data
            kind = "sensor_msgs/msg/CompressedImage"
            message = {"header": message["header"], "format": "16UC1; compressedDepth png", "data": data}
        found.append((time, topic, kind, message))
    assert_read(read_trial(write_mcap(tmp_path / "a.mcap", found), TOPICS, ARM))


@pytest.mark.parametrize("factor", [0.01, 0.1, 10, 1000])
def test_a_unit_mistaken_by_a_power_of_ten_is_said(tmp_path, factor):
    depth = np.full((48, 64), 0.4 * factor, np.float32)
    changed = [
        (t, topic, kind, messages.depth_image(depth, "32FC1", m["header"]) if topic == TOPICS.depth else m)
        for t, topic, kind, m in entries()
    ]
    with pytest.raises(RecordingError, match=f"topic {TOPICS.depth}: depth image whose median is"):
        read_trial(write_mcap(tmp_path / "a.mcap", changed), TOPICS, ARM)


def test_a_lens_of_another_model_is_refused(tmp_path):
    changed = [
        (t, topic, kind, m | ({"distortion_model": "equidistant", "d": [0.1]} if topic == TOPICS.camera_info else {}))
        for t, topic, kind, m in entries()
    ]
    with pytest.raises(RecordingError, match="distortion_model 'equidistant'; it takes plumb_bob"):
        read_trial(write_mcap(tmp_path / "a.mcap", changed), TOPICS, ARM)


def test_rosbags_reads_every_message_of_the_simulated_robot(tmp_path):
    from rosbags.highlevel import AnyReader

    write_trial(tmp_path / "a.mcap", trial(), SIMULATED_TOPICS, "16UC1")
    with AnyReader([tmp_path / "a.mcap"]) as reader:
        read = [reader.deserialize(raw, connection.msgtype) for connection, _, raw in reader.messages()]
    assert len(read) == 25
    assert CLOSE_S < SHUT_S
