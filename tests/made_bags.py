"""Bags as labs record them: TF, joints that close, a video of depth, in any of rosbag2's forms."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from mcap_ros2._dynamic import serialize_dynamic
from scipy.spatial.transform import Rotation

from graspfn.params import Arm, Topics
from graspfn.robot import messages
from graspfn.robot.trial import METADATA

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
ARM = Arm("tf", "table", "up", "base_link", "tool", "x", ("finger_1", "finger_2"), 1, None)
SAID = {
    "object": "cup",
    "placement": "2",
    "method": "Best Grasp",
    "network": "fcn",
    "sigma_uv_mm": "6.2",
    "sigma_theta_deg": "4.7",
    "simulated": "false",
}
T0 = 1_700_000_000_000_000_000  # a wall clock
COMMAND_S, CLOSE_S, SHUT_S, VERDICT_S = 1.0, 3.0, 3.5, 5.0
COMMANDED = np.array([0.05, -0.03, 0.7])
ACHIEVED = np.array([0.053, -0.027, 0.72])
T_BASE_TABLE = np.array([[0.0, -1, 0, 0.5], [1, 0, 0, 0.1], [0, 0, 1, 0.02], [0, 0, 0, 1]])
ENCODERS = {kind: serialize_dynamic(kind, text)[kind] for kind, text in messages.SCHEMAS.items()}

Entry = tuple[int, str, str, dict[str, Any]]


def at(seconds: float) -> int:
    return T0 + round(seconds * 1e9)


def grasp_frame(q: np.ndarray) -> np.ndarray:
    """T_table_tool (4, 4) of a gripper over q that points down."""
    T = np.eye(4)
    T[:3, :3] = (Rotation.from_euler("z", -q[2]) * Rotation.from_euler("x", np.pi)).as_matrix()
    T[:3, 3] = q[0], -q[1], 0.03
    return T


def transform(seconds: float, parent: str, child: str, T: np.ndarray) -> dict[str, Any]:
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat().tolist()
    return {
        "header": messages.header(at(seconds), parent),
        "child_frame_id": child,
        "transform": {
            "translation": dict(zip("xyz", T[:3, 3].tolist(), strict=True)),
            "rotation": {"x": x, "y": y, "z": z, "w": w},
        },
    }


def tool_pose(seconds: float) -> np.ndarray:
    """T_table_tool: it arrives before the fingers close, waits, and is elsewhere a second later."""
    if seconds < COMMAND_S + 1:
        return grasp_frame(np.add(ACHIEVED, [0.2, 0.1, 0.3]))
    if seconds < SHUT_S + 0.5:
        return grasp_frame(ACHIEVED)
    lifted = grasp_frame(np.add(ACHIEVED, [0.1, 0, 0]))
    lifted[2, 3] = 0.3
    return lifted


def entries(depth: np.ndarray | None = None, shut: float = 0.6, held: bool = True) -> list[Entry]:
    """All messages of a trial, in order of time. shut: where the finger joints end; open is 0.1, on the way 0.3."""
    depth = np.full((48, 64), 0.4, np.float32) if depth is None else depth
    found: list[Entry] = []
    K = np.array([[57.0, 0, 31.5], [0, 57, 23.5], [0, 0, 1]])
    for i in range(60):
        s = 0.1 * i
        stamp = messages.header(at(s), "camera_optical")
        seen = depth if s <= COMMAND_S else depth + 1
        found.append((at(s), TOPICS.depth, "sensor_msgs/msg/Image", messages.depth_image(seen, "16UC1", stamp)))
        info = messages.camera_info(K, depth.shape, stamp)
        found.append((at(s), TOPICS.camera_info, "sensor_msgs/msg/CameraInfo", info))
    for i in range(600):
        s = 0.01 * i
        finger = np.interp(s, [0, 1.2, 1.6, CLOSE_S, SHUT_S], [0.3, 0.3, 0.1, 0.1, shut])
        state = messages.joint_state(
            ("wrist", "finger_1", "finger_2"), np.array([s, finger, finger]), messages.header(at(s), "")
        )
        found.append((at(s) + 1000, TOPICS.joints, "sensor_msgs/msg/JointState", state))
        moving = [transform(s, "base_link", "tool", T_BASE_TABLE @ tool_pose(s))]
        if i % 2 == 0:
            found.append((at(s) + 2000, TOPICS.tf, "tf2_msgs/msg/TFMessage", {"transforms": moving}))
    static = [transform(0, "base_link", "table", T_BASE_TABLE)]
    static.append(
        transform(
            0, "table", "camera_optical", np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0.4], [0, 0, 0, 1]])
        )
    )
    found.append((at(0), TOPICS.tf_static, "tf2_msgs/msg/TFMessage", {"transforms": static}))
    pose = messages.pose_stamped(COMMANDED, messages.header(at(COMMAND_S), "table"))
    found.append((at(COMMAND_S), TOPICS.commanded, "geometry_msgs/msg/PoseStamped", pose))
    found.append((at(VERDICT_S), TOPICS.outcome, "std_msgs/msg/Bool", {"data": held}))
    return sorted(found, key=lambda entry: entry[0])


def write_mcap(
    path: Path, found: list[Entry], said: dict[str, str] | None = SAID, index: bool = True, **options: Any
) -> Path:
    """By the writer of MCAP itself; index: False for none of what may be left out."""
    bare = {} if index else dict(
        index_types=IndexType.NONE, repeat_channels=False, repeat_schemas=False, use_statistics=False,
        use_summary_offsets=False,
    )  # fmt: skip
    with path.open("wb") as stream:
        writer = McapWriter(stream, **({"compression": CompressionType.NONE} | bare | options))
        writer.start("ros2", "test")
        schemas: dict[str, int] = {}
        channels: dict[str, int] = {}
        for time, topic, kind, message in found:
            if topic not in channels:
                if kind not in schemas:
                    schemas[kind] = writer.register_schema(kind, "ros2msg", messages.SCHEMAS[kind].encode())
                channels[topic] = writer.register_channel(topic, "cdr", schemas[kind])
            writer.add_message(channels[topic], time, ENCODERS[kind](message), time)
        if said:
            writer.add_metadata(METADATA, said)
        writer.finish()
    return path


def arm(**changes: Any) -> Arm:
    return dataclasses.replace(ARM, **changes)
