"""One trial as an MCAP file that rosbag2 and Foxglove open, as `ros2 bag record` would have recorded it.

The bytes depend on the trial alone, and on who made it. Times look like a wall clock's, and no two trials share them,
but they follow from what the trial was.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from typing import Any

from mcap.writer import CompressionType, Writer
from mcap_ros2._dynamic import serialize_dynamic

from graspfn.params import Topics
from graspfn.robot import messages
from graspfn.robot.gantry import ARRIVED_S, CAMERA, LOOK_S, Gantry
from graspfn.robot.ros_channels import channel_metadata
from graspfn.robot.trial import FRAME, METADATA, PLANNED, Condition, TrialRecording
from graspfn.seeds import seed_of

DESCRIPTION = "/robot_description"
SOFTWARE = "graspfn.software"  # metadata record: what made the recording
LIBRARY = "graspfn, simulated robot"
EPOCH_S, SPAN_S = 978_307_200, 365 * 86_400  # the year 2001: no real robot ran this software then
SEEN_S = -0.4  # since the command
# By the recorder's clock messages come later than they are stamped, an image the longest.
LATE_NS = {"sensor_msgs/msg/Image": 31_000_000, "sensor_msgs/msg/CameraInfo": 30_900_000}
LATE_NS |= {"tf2_msgs/msg/TFMessage": 500_000}
USUAL_LATE_NS = 300_000

_ENCODERS = {kind: serialize_dynamic(kind, text)[kind] for kind, text in messages.SCHEMAS.items()}
Event = tuple[int, str, str, dict[str, Any]]  # stamp [ns], topic, type, message


def command_ns(condition: Condition) -> int:
    """When the command of a trial was sent, by the simulated robot's clock: whole seconds within a year."""
    return (EPOCH_S + seed_of("clock", *condition.to_metadata().values()) % SPAN_S) * 10**9


def _events(trial: TrialRecording, topics: Topics, depth_encoding: str, arm: Gantry | None) -> Iterator[Event]:
    zero = command_ns(trial.condition)

    def at(seconds: float) -> int:
        return zero + round(float(seconds) * 1e9)

    if arm is not None:
        start = at(-LOOK_S)
        yield start, DESCRIPTION, "std_msgs/msg/String", {"data": arm.urdf()}
        fixed = [messages.transform(parent, child, T, start) for parent, child, T in arm.fixed]
        yield start, topics.tf_static, "tf2_msgs/msg/TFMessage", {"transforms": fixed}
    seen = messages.header(at(SEEN_S), CAMERA)
    info = messages.camera_info(trial.camera_matrix, trial.depth.shape, seen, trial.distortion)
    yield at(SEEN_S), topics.camera_info, "sensor_msgs/msg/CameraInfo", info
    yield at(SEEN_S), topics.depth, "sensor_msgs/msg/Image", messages.depth_image(trial.depth, depth_encoding, seen)
    for topic, q, seconds in (
        (topics.commanded, trial.commanded, 0.0),
        (topics.achieved, trial.achieved, ARRIVED_S),
    ):
        if q is not None:
            message = messages.pose_stamped(q, messages.header(at(seconds), FRAME))
            yield at(seconds), topic, "geometry_msgs/msg/PoseStamped", message
    for seconds, positions in zip(trial.joint_time_s, trial.joint_positions, strict=True):
        message = messages.joint_state(trial.joint_names, positions, messages.header(at(seconds), ""))
        yield at(seconds), topics.joints, "sensor_msgs/msg/JointState", message
        if arm is not None:
            moving = [
                messages.transform(parent, child, T, at(seconds)) for parent, child, T in arm.transforms(positions)
            ]
            yield at(seconds), topics.tf, "tf2_msgs/msg/TFMessage", {"transforms": moving}
    end = at(max([ARRIVED_S, *trial.joint_time_s[-1:]]) + 0.1)
    yield end, topics.outcome, "std_msgs/msg/Bool", {"data": bool(trial.success)}


def trial_bytes(
    trial: TrialRecording,
    topics: Topics,
    depth_encoding: str,
    arm: Gantry | None = None,
    software: Mapping[str, str] | None = None,
) -> bytes:
    """The MCAP file of a trial.

    depth_encoding: 16UC1 (mm, 0 invalid) or 32FC1 (m, NaN invalid). arm: whose frames and description are recorded,
    its joints those of the trial. software: what made the recording, version and models, as text.
    """
    stream = io.BytesIO()
    writer = Writer(stream, compression=CompressionType.ZSTD)
    writer.start("ros2", LIBRARY if trial.condition.simulated else "graspfn")
    planned = {} if trial.commanded is not None else {PLANNED: "false"}
    writer.add_metadata(METADATA, trial.condition.to_metadata() | planned)
    if software:
        writer.add_metadata(SOFTWARE, {**software, "simulated": str(trial.condition.simulated).lower()})
    logged = sorted(
        (
            (stamp + LATE_NS.get(kind, USUAL_LATE_NS), stamp, topic, kind, message)
            for stamp, topic, kind, message in _events(trial, topics, depth_encoding, arm)
        ),
        key=lambda event: event[:3],
    )
    latched = {DESCRIPTION, topics.tf_static}
    schemas: dict[str, int] = {}
    channels: dict[str, int] = {}
    for sequence, (time, stamp, topic, kind, message) in enumerate(logged):
        if kind not in schemas:
            schemas[kind] = writer.register_schema(kind, "ros2msg", messages.SCHEMAS[kind].encode())
        if topic not in channels:
            about = channel_metadata(kind, topic in latched)
            channels[topic] = writer.register_channel(topic, "cdr", schemas[kind], about)
        writer.add_message(channels[topic], time, _ENCODERS[kind](message), stamp, sequence)  # published when stamped
    writer.finish()
    return stream.getvalue()
