"""ROS 2 message definitions of the recorded topics, as `ros2msg` schema text, and messages built from plain values.

The definitions are those of ROS 2's common_interfaces, field for field; a message is a nested dict of its fields.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from graspfn.imaging.holes import holes

MOST_MM = 65534  # that 16UC1 holds: 65535 is a code for no measurement, as 0 is

_SEPARATOR = "=" * 80

_HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
_TIME = "int32 sec\nuint32 nanosec\n"
_POINT = "float64 x\nfloat64 y\nfloat64 z\n"
_QUATERNION = "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"
_POSE = "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
_REGION = "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"


def _schema(fields: str, **nested: str) -> str:
    """A message's fields followed by the definitions of the messages inside it (`std_msgs__Header` names a type)."""
    parts = [f"MSG: {name.replace('__', '/')}\n{definition}" for name, definition in nested.items()]
    return f"\n{_SEPARATOR}\n".join([fields, *parts])


SCHEMAS = {
    "sensor_msgs/msg/Image": _schema(
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
        "uint8[] data\n",
        std_msgs__Header=_HEADER,
        builtin_interfaces__Time=_TIME,
    ),
    "sensor_msgs/msg/CameraInfo": _schema(
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n"
        "float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n",
        std_msgs__Header=_HEADER,
        builtin_interfaces__Time=_TIME,
        sensor_msgs__RegionOfInterest=_REGION,
    ),
    "geometry_msgs/msg/PoseStamped": _schema(
        "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
        std_msgs__Header=_HEADER,
        builtin_interfaces__Time=_TIME,
        geometry_msgs__Pose=_POSE,
        geometry_msgs__Point=_POINT,
        geometry_msgs__Quaternion=_QUATERNION,
    ),
    "sensor_msgs/msg/JointState": _schema(
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
        std_msgs__Header=_HEADER,
        builtin_interfaces__Time=_TIME,
    ),
    "std_msgs/msg/Bool": "bool data\n",
    "std_msgs/msg/String": "string data\n",
    "sensor_msgs/msg/CompressedImage": _schema(
        "std_msgs/Header header\nstring format\nuint8[] data\n",
        std_msgs__Header=_HEADER,
        builtin_interfaces__Time=_TIME,
    ),
    "tf2_msgs/msg/TFMessage": _schema(
        "geometry_msgs/TransformStamped[] transforms\n",
        geometry_msgs__TransformStamped="std_msgs/Header header\nstring child_frame_id\n"
        "geometry_msgs/Transform transform\n",
        std_msgs__Header=_HEADER,
        builtin_interfaces__Time=_TIME,
        geometry_msgs__Transform="geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
        geometry_msgs__Vector3=_POINT,
        geometry_msgs__Quaternion=_QUATERNION,
    ),
}


def header(time_ns: int, frame: str) -> dict[str, Any]:
    """std_msgs/Header."""
    return {"stamp": {"sec": time_ns // 10**9, "nanosec": time_ns % 10**9}, "frame_id": frame}


def depth_image(depth: np.ndarray, encoding: str, stamp: dict[str, Any]) -> dict[str, Any]:
    """sensor_msgs/Image of depth (height, width), metres, NaN where nothing was measured.

    encoding: 32FC1, metres; 16UC1, millimetres, 0 where nothing was measured or more than 16 bits hold.
    """
    height, width = depth.shape
    millimetres = np.rint(np.where(holes(depth, None) | (depth > MOST_MM / 1000), 0, depth) * 1000)
    pixels = millimetres.astype("<u2") if encoding == "16UC1" else depth.astype("<f4")
    return {
        "header": stamp,
        "height": height,
        "width": width,
        "encoding": encoding,
        "is_bigendian": 0,
        "step": width * pixels.itemsize,
        "data": pixels.tobytes(),
    }


def camera_info(
    matrix: np.ndarray, shape: tuple[int, int], stamp: dict[str, Any], distortion: tuple[float, ...] = ()
) -> dict[str, Any]:
    """sensor_msgs/CameraInfo: matrix (3, 3), image shape (height, width), distortion in OpenCV's order, of up to 8."""
    projection = np.column_stack([matrix, np.zeros(3)])
    return {
        "header": stamp,
        "height": shape[0],
        "width": shape[1],
        "distortion_model": "plumb_bob" if len(distortion) <= 5 else "rational_polynomial",
        "d": [*distortion, *[0.0] * (5 - len(distortion))],
        "k": matrix.ravel().tolist(),
        "r": np.eye(3).ravel().tolist(),
        "p": projection.ravel().tolist(),
        "binning_x": 0,
        "binning_y": 0,
        "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    }


def pose_stamped(q: np.ndarray, stamp: dict[str, Any]) -> dict[str, Any]:
    """geometry_msgs/PoseStamped of a gripper pose q (u, v, theta) on the table: `geometry.transforms.T_world_grasp`."""
    u, v, theta = (float(value) for value in q)
    orientation = {"x": 0.0, "y": 0.0, "z": float(np.sin(-theta / 2)), "w": float(np.cos(-theta / 2))}
    return {"header": stamp, "pose": {"position": {"x": u, "y": -v, "z": 0.0}, "orientation": orientation}}


def joint_state(names: tuple[str, ...], positions: np.ndarray, stamp: dict[str, Any]) -> dict[str, Any]:
    """sensor_msgs/JointState of positions (len(names),), metres or radians."""
    values = np.asarray(positions, dtype=float).tolist()
    return {"header": stamp, "name": list(names), "position": values, "velocity": [], "effort": []}


def transform(parent: str, child: str, T: np.ndarray, time_ns: int) -> dict[str, Any]:
    """geometry_msgs/TransformStamped of T_parent_child (4, 4)."""
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat().tolist()
    moved = dict(zip("xyz", T[:3, 3].tolist(), strict=True))
    turned = {"x": x, "y": y, "z": z, "w": w}
    return {
        "header": header(time_ns, parent),
        "child_frame_id": child,
        "transform": {"translation": moved, "rotation": turned},
    }
