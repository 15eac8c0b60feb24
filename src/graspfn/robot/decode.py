"""ROS 2 messages to arrays: depth images, poses, joint states."""

from __future__ import annotations

import io
import struct
import zlib
from typing import Any

import numpy as np
from PIL import Image

from graspfn.imaging.camera import Camera
from graspfn.imaging.holes import holes
from graspfn.robot.messages import MOST_MM
from graspfn.robot.target import target_in_image
from graspfn.robot.tf import rigid
from graspfn.robot.trial import FRAME, RecordingError

PIXELS = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}  # mono16: how some drivers name 16UC1
LENSES = ("", "none", "plumb_bob", "rational_polynomial")  # others mean something else by the same numbers
NEAREST_M, FARTHEST_M = 0.1, 3.0  # from a camera to the table that it looks at, and what stands on it
MOST_PIXELS = 1 << 25


def is_depth(image: Any) -> bool:
    """Whether a sensor_msgs/Image or CompressedImage says that it holds depths."""
    return "compressedDepth" in image.format if hasattr(image, "format") else image.encoding in PIXELS


def depth(image: Any) -> np.ndarray:
    """(height, width) float32, metres, NaN where nothing was measured, of a sensor_msgs/Image or CompressedImage.

    Raises RecordingError where it is no depth image, or one without a single measurement.
    """
    metres = _compressed(image) if hasattr(image, "format") else _plain(image)
    # Every convention of invalid: 0 and NaN, a negative number, infinity beyond the range.
    nothing = holes(metres, None)
    if nothing.all():
        raise RecordingError("depth image without a single measurement: every pixel is zero or invalid")
    return np.where(nothing, np.float32(np.nan), metres)


def check_distance(metres: np.ndarray) -> None:
    """RecordingError where a depth image, NaN for no measurement, is of no table under a camera: another unit."""
    median = float(np.nanmedian(metres))
    if not NEAREST_M <= median <= FARTHEST_M:
        raise RecordingError(
            f"depth image whose median is {median:.3g} m; a camera over a table sees {NEAREST_M} to {FARTHEST_M} m: "
            "16UC1 takes millimetres, 32FC1 metres"
        )


def _plain(image: Any) -> np.ndarray:
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
    return _millimetres(raw) if dtype.kind == "u" else raw.astype(np.float32)


def _millimetres(raw: np.ndarray) -> np.ndarray:
    return np.where(raw > MOST_MM, np.float32(np.nan), raw.astype(np.float32) / 1000)


def _compressed(image: Any) -> np.ndarray:
    """compressed_depth_image_transport: twelve bytes (how, and two numbers A and B), then a PNG of 16 bits.

    Of 16UC1 its pixels are the millimetres; of 32FC1 they are q, for a depth of A / (q - B), and 0 for none.
    """
    encoding, _, how = image.format.partition(";")
    encoding, data = encoding.strip() or "16UC1", bytes(image.data)
    if "rvl" in how.lower():
        raise RecordingError(
            "depth compressed as RVL, which no maintained library reads safely; it takes PNG "
            "(compressedDepth.format: png), or raw images (ros2 run image_transport republish compressedDepth raw)"
        )
    if "compressedDepth" not in how or encoding not in PIXELS:
        raise RecordingError(f"compressed image of format {image.format!r}; it takes '16UC1; compressedDepth png'")
    raw = _png(data[12:])
    if PIXELS[encoding] == "u2":
        return _millimetres(raw)
    a, b = struct.unpack("<ff", data[4:12])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.where(raw == 0, np.nan, np.float32(a) / (raw.astype(np.float32) - np.float32(b))).astype(np.float32)


def _png(data: bytes) -> np.ndarray:
    """(height, width) uint16."""
    try:
        with Image.open(io.BytesIO(data), formats=["PNG"]) as picture:
            if picture.width * picture.height > MOST_PIXELS or picture.mode != "I;16":
                raise RecordingError(
                    f"PNG of {picture.width}x{picture.height} pixels, {picture.mode}; it takes 16 bits"
                )
            return np.asarray(picture, dtype=np.uint16)
    except (OSError, SyntaxError, ValueError, struct.error, zlib.error, Image.DecompressionBombError) as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(f"damaged PNG: {' '.join(str(error).split())}") from None


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


def camera(info: Any, shape: tuple[int, int]) -> Camera:
    """That of a sensor_msgs/CameraInfo, for its depth image of (height, width)."""
    K = camera_matrix(info, shape)
    height, width = shape
    return Camera(width, height, (K[0, 0], K[1, 1], K[0, 2], K[1, 2]), distortion(info))


def distortion(info: Any) -> tuple[float, ...]:
    """Of a sensor_msgs/CameraInfo, in OpenCV's order; empty where there is none."""
    values = tuple(float(value) for value in info.d)
    if not any(values):
        return ()
    if info.distortion_model.lower() not in LENSES:
        raise RecordingError(
            f"distortion_model {info.distortion_model!r}; it takes plumb_bob, rational_polynomial, or rectified images"
        )
    while len(values) > 8 and values[-1] == 0:
        values = values[:-1]
    if len(values) not in (4, 5, 8) or not np.isfinite(values).all():
        raise RecordingError(f"distortion {values}; it takes 4, 5 or 8 numbers, of plumb_bob or rational_polynomial")
    return values


def pose(stamped: Any, closing_axis: str = "x") -> np.ndarray:
    """(3,) (u [m], v [m], theta [rad]) of a geometry_msgs/PoseStamped in the frame `table`."""
    frame = stamped.header.frame_id.lstrip("/")
    if frame != FRAME:
        raise RecordingError(
            f"pose in frame {frame!r}; it takes {FRAME!r}: origin on the table at the image centre, "
            "x along image +x, y along image -y, z up"
        )
    return target_in_image(rigid(stamped.pose.position, stamped.pose.orientation), closing_axis)


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
