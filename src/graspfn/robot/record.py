"""One trial as an MCAP file that rosbag2 and Foxglove open.

The bytes depend on the trial alone: times are simulated, from one second after the epoch (a ROS time of 0 means
"unknown"), not read from a clock.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

from mcap.writer import CompressionType
from mcap_ros2.writer import Writer

from graspfn.params import Topics
from graspfn.robot import messages
from graspfn.robot.trial import FRAME, METADATA, PLANNED, TrialRecording

CAMERA_FRAME = "camera_depth_optical_frame"
RECORDED = (
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CameraInfo",
    "geometry_msgs/msg/PoseStamped",
    "sensor_msgs/msg/JointState",
    "std_msgs/msg/Bool",
)
SEEN_NS = 1_000_000_000
COMMANDED_NS = 1_100_000_000


def _timeline(
    trial: TrialRecording, topics: Topics, depth_encoding: str
) -> Iterator[tuple[int, str, str, dict[str, Any]]]:
    """(time [ns], topic, type, message) of everything in a trial, in order of time."""
    seen = messages.header(SEEN_NS, CAMERA_FRAME)
    info = messages.camera_info(trial.camera_matrix, trial.depth.shape, seen, trial.distortion)
    yield SEEN_NS, topics.camera_info, "sensor_msgs/msg/CameraInfo", info
    image = messages.depth_image(trial.depth, depth_encoding, seen)
    yield SEEN_NS, topics.depth, "sensor_msgs/msg/Image", image
    # The hand is moved kinematically, so it is where it is going at once.
    sent = messages.header(COMMANDED_NS, FRAME)
    for topic, q in ((topics.commanded, trial.commanded), (topics.achieved, trial.achieved)):
        if q is None:
            continue
        yield COMMANDED_NS, topic, "geometry_msgs/msg/PoseStamped", messages.pose_stamped(q, sent)
    end = COMMANDED_NS
    for seconds, positions in zip(trial.joint_time_s, trial.joint_positions, strict=True):
        end = COMMANDED_NS + round(float(seconds) * 1e9)
        message = messages.joint_state(trial.joint_names, positions, messages.header(end, ""))
        yield end, topics.joints, "sensor_msgs/msg/JointState", message
    yield end, topics.outcome, "std_msgs/msg/Bool", {"data": bool(trial.success)}


def trial_bytes(trial: TrialRecording, topics: Topics, depth_encoding: str) -> bytes:
    """The MCAP file of a trial; depth_encoding: 16UC1 (mm, 0 invalid) or 32FC1 (m, NaN invalid)."""
    stream = io.BytesIO()
    writer = Writer(stream, compression=CompressionType.ZSTD)
    planned = {} if trial.commanded is not None else {PLANNED: "false"}
    writer.add_metadata(METADATA, trial.condition.to_metadata() | planned)
    schemas = {name: writer.register_msgdef(name, messages.SCHEMAS[name]) for name in RECORDED}
    for sequence, (time, topic, kind, message) in enumerate(_timeline(trial, topics, depth_encoding)):
        writer.write_message(topic, schemas[kind], message, log_time=time, sequence=sequence)
    writer.finish()
    return stream.getvalue()
