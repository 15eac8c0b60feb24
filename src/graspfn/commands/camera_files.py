"""A camera's intrinsics as ROS writes them, and transforms and covariances in text files."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from graspfn.commands.ending import InputError
from graspfn.geometry.transforms import translation
from graspfn.imaging.camera import Camera
from graspfn.planning.covariance_file import read_covariance
from graspfn.planning.planner import check_rigid
from graspfn.planning.uncertainty import PlanningError
from graspfn.robot import decode
from graspfn.robot.trial import RecordingError

PARTS = {"translation": "xyz", "rotation": "xyzw"}
REGION = {"x_offset": 0, "y_offset": 0, "width": 0, "height": 0}


def read_camera(path: Path, shape: tuple[int, int]) -> Camera:
    """The camera of an image (height, width): CameraInfo as `ros2 topic echo` or camera_calibration write it."""
    values = _yaml(path, "--camera")
    if not isinstance(values, dict):
        raise InputError(f"--camera {path}: takes a CameraInfo, as ROS writes it")
    try:
        return decode.camera(_info(values, shape), shape)
    except KeyError as error:
        raise InputError(
            f"--camera {path}: {error.args[0]}: missing; it takes a CameraInfo, as ROS writes it"
        ) from None
    except (TypeError, ValueError, AttributeError) as error:  # RecordingError is a ValueError
        raise InputError(f"--camera {path}: {' '.join(str(error).split())}") from None


def _info(values: dict[str, Any], shape: tuple[int, int]) -> SimpleNamespace:
    if "camera_matrix" in values:
        k, d = values["camera_matrix"]["data"], values.get("distortion_coefficients", {}).get("data", [])
        width, height = values["image_width"], values["image_height"]
    else:  # ROS 1 had capitals
        k, d = values["k"] if "k" in values else values["K"], values.get("d", values.get("D", []))
        width, height = values["width"], values["height"]
    if len(k) != 9:
        raise RecordingError(f"K has {len(k)} numbers; it takes 9, row by row")
    return SimpleNamespace(
        k=[float(number) for number in k],
        d=[float(number) for number in d],
        width=int(width),
        height=int(height),
        distortion_model=values.get("distortion_model") or "",
        binning_x=int(values.get("binning_x", 0)),
        binning_y=int(values.get("binning_y", 0)),
        roi=SimpleNamespace(**(REGION | (values.get("roi") or {}))),
    )


def read_transform(path: Path, option: str) -> np.ndarray:
    """(4, 4): sixteen numbers row by row, or translation and rotation (x, y, z, w) as ROS has them, in YAML."""
    T = _ros_transform(path, option) if path.suffix.lower() in (".yaml", ".yml") else read_matrix(path, option, 4)
    try:
        return check_rigid(T, f"{option} {path}")
    except PlanningError as error:
        raise InputError(str(error)) from None


def _ros_transform(path: Path, option: str) -> np.ndarray:
    values = _yaml(path, option)
    values = values.get("transform", values) if isinstance(values, dict) else {}
    try:
        shift, turn = ([float(values[key][axis]) for axis in axes] for key, axes in PARTS.items())
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{option} {path}: takes translation: {{x, y, z}} and rotation: {{x, y, z, w}}") from None
    if not np.isclose(np.linalg.norm(turn), 1, atol=1e-3):
        raise InputError(f"{option} {path}: rotation is of length {np.linalg.norm(turn):.3g}; it takes 1")
    T = translation(*shift)
    T[:3, :3] = Rotation.from_quat(turn).as_matrix()
    return T


def read_matrix(path: Path, option: str, size: int) -> np.ndarray:
    """(size, size) numbers of a text file, between blanks, commas or lines; # begins a comment."""
    return matrix_of(_text(path, option), f"{option} {path}", size)


def matrix_of(text: str, name: str, size: int) -> np.ndarray:
    """The same of a text; InputError begins with its name."""
    lines = (line.partition("#")[0].replace(",", " ") for line in text.splitlines())
    words = [word for line in lines for word in line.split()]
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError as error:
        raise InputError(f"{name}: {error}") from None
    if numbers.size != size * size or not np.isfinite(numbers).all():
        raise InputError(f"{name}: has {numbers.size} numbers; it takes {size * size} finite ones")
    return numbers.reshape(size, size)


def read_covariance_file(path: Path, option: str) -> np.ndarray:
    """(3, 3) of (u, v, theta), metres and radians: nine numbers, or, in YAML, what `graspfn logs` has written."""
    if path.suffix.lower() not in (".yaml", ".yml"):
        return read_matrix(path, option, 3)
    try:
        return read_covariance(path)
    except PlanningError as error:
        raise InputError(f"{option} {error}") from None


def _text(path: Path, option: str) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{option} {path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(f"{option} {path}: not UTF-8") from None


def _yaml(path: Path, option: str) -> Any:
    """The first document: `ros2 topic echo` ends each with ---."""
    try:
        return next(iter(yaml.safe_load_all(_text(path, option))), None)
    except yaml.YAMLError as error:
        raise InputError(f"{option} {path}: not YAML: {' '.join(str(error).split())}") from None
