"""Depth images as people have them: .png, .tiff, .npy, organised .pcd, and topics of .mcap recordings."""

from __future__ import annotations

import enum
from pathlib import Path

import numpy as np

from graspfn.commands.depth_pixels import read_pixels
from graspfn.commands.ending import InputError
from graspfn.imaging.camera import Camera
from graspfn.imaging.holes import holes
from graspfn.robot.decode import FARTHEST_M, NEAREST_M

SUFFIXES = (".png", ".tif", ".tiff", ".npy", ".pcd", ".mcap")
BEYOND_M = 1e5  # what is further was not measured: codes such as 1e30


class Unit(str, enum.Enum):
    """Of the numbers in a depth image."""

    MM = "mm"
    TENTH_MM = "0.1mm"
    M = "m"

    __str__ = str.__str__  # Python 3.10 has no StrEnum

    @property
    def metres(self) -> float:
        return {"mm": 1e-3, "0.1mm": 1e-4, "m": 1.0}[self.value]


def read_depth(path: Path, unit: Unit | None, topic: str | None) -> tuple[np.ndarray, Camera | None]:
    """(height, width) float32, metres, NaN where nothing was measured; and the camera, where the file has one.

    unit: None takes whole numbers for millimetres, others for metres. InputError names the file, and the option.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: takes a depth image: {' '.join(SUFFIXES)}")
    if topic is not None and suffix != ".mcap":
        raise InputError(f"--topic {topic}: {path} has no topics; it takes an .mcap recording")
    if unit is not None and suffix in (".pcd", ".mcap"):
        raise InputError(f"--depth-unit {unit}: {path} says itself what its unit is; leave the option out")
    try:
        if suffix == ".mcap":
            from graspfn.commands.mcap_images import read_topic

            depth, camera = read_topic(path, topic)
        elif suffix == ".pcd":
            from graspfn.commands.organised_clouds import read_cloud

            depth, camera = read_cloud(path)
        else:
            with path.open("rb") as stream:
                return depth_of(read_pixels(stream, suffix, str(path)), unit, str(path)), None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    return _checked(depth, str(path), None), camera


def depth_of(pixels: np.ndarray, unit: Unit | None, name: str) -> np.ndarray:
    """(height, width) of numbers in a unit, as for `read_depth` -> metres. InputError names the image."""
    used = unit or (Unit.MM if pixels.dtype.kind in "iu" else Unit.M)
    return _checked(_in_metres(pixels, used), name, used)


def _checked(depth: np.ndarray, name: str, used: Unit | None) -> np.ndarray:
    """float32, NaN where nothing was measured; used: the unit that was taken, None where the file has its own."""
    nothing = holes(depth, None) | (depth > BEYOND_M)
    depth = np.where(nothing, np.float32(np.nan), depth).astype(np.float32)
    _question(depth, name, used)
    return depth


def _in_metres(pixels: np.ndarray, unit: Unit) -> np.ndarray:
    if pixels.dtype.kind == "f":
        return pixels * unit.metres
    nothing = pixels == np.iinfo(pixels.dtype).max  # a code for no measurement, as 0 is
    return np.where(nothing, np.nan, pixels * unit.metres)


def _question(depth: np.ndarray, name: str, used: Unit | None) -> None:
    """InputError where the depths are none of a table under a camera, with the unit that would make them so."""
    measured = depth[np.isfinite(depth)]
    if not len(measured):
        raise InputError(f"{name}: no pixel holds a depth; it takes at least one")
    middle = float(np.median(measured))
    if NEAREST_M <= middle <= FARTHEST_M:
        return
    others = {unit: middle * unit.metres / used.metres for unit in Unit} if used else {}
    likely = [f"--depth-unit {unit} makes it {m:.3g}" for unit, m in others.items() if NEAREST_M <= m <= FARTHEST_M]
    taken = f"--depth-unit {used}" if used else "its own unit"
    hint = f"; {', '.join(likely)}" if likely else ""
    raise InputError(f"{name}: {taken} has the middle of its depths at {middle:.3g} m, where no table is{hint}")
