"""Organised point clouds in .pcd files: one point to a pixel, in the camera's axes, metres."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from graspfn.commands.ending import InputError
from graspfn.imaging.camera import Camera

TYPES = {"F": "f", "I": "i", "U": "u"}
CLOSE_PX = 0.5  # of a pinhole through the points; more is a lens, or another frame than the camera's


def read_cloud(path: Path) -> tuple[np.ndarray, Camera]:
    """Depth (height, width), metres, of an organised cloud, and the camera that its points fit."""
    content = path.read_bytes()
    header: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in header:
        end = content.find(b"\n", start)
        if end < 0:
            raise InputError(f"{path}: no .pcd file: its header has no DATA")
        words = content[start:end].decode("ascii", "replace").split()
        start = end + 1
        if words and not words[0].startswith("#"):
            header[words[0]] = words[1:]
    try:
        points = _points(header, content[start:])
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise InputError(f"{path}: cannot be read as .pcd: {type(error).__name__} {error}") from None
    if points.shape[0] < 2:
        raise InputError(f"{path}: not organised (HEIGHT 1); it takes a cloud with a point to every pixel")
    return points[..., 2], _camera(points, path)


def _points(header: dict[str, list[str]], data: bytes) -> np.ndarray:
    """(height, width, 3)."""
    width, height = int(header["WIDTH"][0]), int(header["HEIGHT"][0])
    names, counts = header["FIELDS"], [int(n) for n in header.get("COUNT", ["1"] * len(header["FIELDS"]))]
    kind = header["DATA"][0]
    if kind == "ascii":
        columns = [sum(counts[: names.index(name)]) for name in "xyz"]
        values = np.array(data.split(), dtype=float).reshape(height * width, sum(counts))
        return values[:, columns].reshape(height, width, 3)
    if kind != "binary":
        raise ValueError(f"DATA {kind}; it takes ascii and binary (pcl_convert_pcd_ascii_binary IN OUT 1)")
    formats = [f"<{TYPES[t]}{s}" for t, s in zip(header["TYPE"], header["SIZE"], strict=True)]
    unique = [f"{i}" for i in range(len(names))]  # padding fields share the name _
    layout = np.dtype([(n, f, (c,)) for n, f, c in zip(unique, formats, counts, strict=True)])
    cloud = np.frombuffer(data, layout, height * width)
    xyz = [cloud[unique[names.index(name)]][:, 0].astype(float) for name in "xyz"]
    return np.stack(xyz, axis=-1).reshape(height, width, 3)


def _camera(points: np.ndarray, path: Path) -> Camera:
    """The pinhole that put the points (height, width, 3) at their pixels."""
    height, width, _ = points.shape
    rows, columns = np.nonzero(np.isfinite(points).all(axis=-1) & (points[..., 2] > 0))
    seen = points[rows, columns]
    K = []
    for pixels, along in ((columns, seen[:, 0]), (rows, seen[:, 1])):
        slopes = np.column_stack([along / seen[:, 2], np.ones(len(seen))])
        (focal, centre), *_ = np.linalg.lstsq(slopes, pixels.astype(float), rcond=None)
        K.append((float(focal), float(centre)))
        if not len(seen) or focal <= 0 or np.abs(slopes @ [focal, centre] - pixels).max() > CLOSE_PX:
            raise InputError(f"{path}: its points fit no pinhole camera; it takes them in the camera's axes, z forward")
    (fx, cx), (fy, cy) = K
    return Camera(width, height, (fx, fy, cx, cy))
