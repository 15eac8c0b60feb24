"""ROS 2 messages to arrays: depth images, poses, joint states."""

from __future__ import annotations

from typing import Any

import numpy as np

from graspfn.imaging.holes import holes
from graspfn.robot.messages import MOST_MM
from graspfn.robot.trial import FRAME, RecordingError

PIXELS = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}  # mono16: how some drivers name 16UC1
LENSES = ("", "none", "plumb_bob", "rational_polynomial")  # others mean something else by the same numbers
REACH_M = 5.0  # farther from the image centre no arm over the table reaches: another unit


def depth(image: Any) -> np.ndarray:
    """(height, width) float32, metres, NaN where nothing was measured, of a sensor_msgs/Image.

    Raises RecordingError where it is no depth image, or one without a single measurement.
    """
    if image.encoding not in PIXELS:
        raise RecordingError(f"depth encoding {image.encoding!r}; it takes 16UC1 (mm) or 32FC1 (m)")
    dtype = np.dtype((">" if image.is_bigendian else "<") + PIXELS[image.encoding])
    height, width, step = image.height, image.width, image.step
    if not height or not width:
        raise RecordingError(f"depth image of {height} rows of {width} pixels; it takes at least one pixel")
    if step < width * dtype.itemsize or len(image.data) < height * step:
        raise RecordingError(
            f"depth image of {height} rows of {width} {image.encoding} pixels in {step} bytes each "
            f"does not fit its {len(image.data)} bytes"
        )
    rows = np.frombuffer(image.data, np.uint8, height * step).reshape(height, step)
    # Rows may be padded, so the pixels are copied together before their bytes are taken as numbers.
    raw = np.ascontiguousarray(rows[:, : width * dtype.itemsize]).view(dtype)
    metres = raw.astype(np.float32)
    if dtype.kind == "u":
        metres = np.where(raw > MOST_MM, np.float32(np.nan), metres / 1000)
    # Every convention of invalid: 0 and NaN, a negative number, infinity beyond the range.
    nothing = holes(metres, None)
    if nothing.all():
        raise RecordingError("depth image without a single measurement: every pixel is zero or invalid")
    return np.where(nothing, np.float32(np.nan), metres)


def camera_matrix(info: Any, shape: tuple[int, int]) -> np.ndarray:
    """K: (3, 3) float64 of the depth image of a sensor_msgs/CameraInfo; shape: that image's (height, width).

    ROS gives K for the whole sensor: a region of interest moves it, binning divides it.
    """
    K = np.array(info.k, dtype=float).reshape(3, 3)
    if not (np.isfinite(K).all() and K[0, 0] > 0 and K[1, 1] > 0):
        raise RecordingError(f"camera whose K is {K.ravel().tolist()}; it takes focal lengths above 0, in pixels")
    roi, bins = info.roi, np.array([max(1, info.binning_x), max(1, info.binning_y)])
    width, height = np.array([roi.width or info.width, roi.height or info.height]) // bins
    if (height, width) != shape:
        raise RecordingError(f"camera of {width}x{height} pixels; the depth image has {shape[1]}x{shape[0]}")
    K[:2, 2] -= roi.x_offset, roi.y_offset
    K[:2] /= bins[:, None]
    return K


def distortion(info: Any) -> tuple[float, ...]:
    """Of a sensor_msgs/CameraInfo, in OpenCV's order; empty where there is none."""
    values = tuple(float(value) for value in info.d)
    if not any(values):
        return ()
    if info.distortion_model.lower() not in LENSES:
        raise RecordingError(
            f"distortion_model {info.distortion_model!r}; it takes plumb_bob, rational_polynomial, or rectified images"
        )
    if len(values) not in (4, 5, 8) or not np.isfinite(values).all():
        raise RecordingError(f"distortion {values}; it takes 4, 5 or 8 numbers, of plumb_bob or rational_polynomial")
    return values


def pose(stamped: Any) -> np.ndarray:
    """(3,) (u [m], v [m], theta [rad]) of a geometry_msgs/PoseStamped in the frame `table`."""
    frame = stamped.header.frame_id.lstrip("/")
    if frame != FRAME:
        raise RecordingError(
            f"pose in frame {frame!r}; it takes {FRAME!r}: origin on the table at the image centre, "
            "x along image +x, y along image -y, z up"
        )
    position, orientation = stamped.pose.position, stamped.pose.orientation
    x, y, z, w = np.array([orientation.x, orientation.y, orientation.z, orientation.w])
    norm = x * x + y * y + z * z + w * w
    if not (np.isfinite(norm) and norm > 0.5):
        raise RecordingError("pose whose orientation is not a unit quaternion")
    # The rotated x axis, along which the jaws close; world y is the image's -v.
    closing_u = (w * w + x * x - y * y - z * z) / norm
    closing_v = -2 * (x * y + w * z) / norm
    if np.hypot(closing_u, closing_v) < 0.5:
        raise RecordingError("pose whose x axis is more than 60 degrees off the table; the jaws close along it")
    result = np.array([position.x, -position.y, np.arctan2(closing_v, closing_u) % np.pi])
    if not np.all(np.isfinite(result)):
        raise RecordingError("pose whose position is not finite")
    if np.hypot(*result[:2]) > REACH_M:
        raise RecordingError(f"pose {np.hypot(*result[:2]):g} m from the image centre; it takes metres, on the table")
    return result


def joints(stamped: list[tuple[int, Any]], start_ns: int) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """Names, times (T,) [s] since start_ns and positions (T, names) of (time [ns], sensor_msgs/JointState) messages.

    Messages may name different joints, in any order: a joint that one lacks is NaN there.
    """
    names = tuple(dict.fromkeys(name for _, message in stamped for name in message.name))
    positions = np.full((len(stamped), len(names)), np.nan)
    for row, (_, message) in enumerate(stamped):
        for name, value in zip(message.name, message.position, strict=False):
            positions[row, names.index(name)] = value
    time_s = np.array([time - start_ns for time, _ in stamped], dtype=np.float64) * 1e-9
    return names, time_s, positions
