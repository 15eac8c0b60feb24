"""OFF files as found in the wild: ModelNet's glued headers, copies without one, lists of points."""

from __future__ import annotations

import re

import numpy as np
import trimesh

from graspfn.formats.polygons import triangles

POINTS_NOTE = "hull of a list of points"
HEADER = re.compile(r"(?:ST)?C?N?OFF(.*)", re.IGNORECASE)  # with texture, colours, normals: extra columns, passed over
MIN_POINTS = 4  # a tetrahedron


def read_off(data: bytes) -> trimesh.Trimesh:
    """The mesh of an OFF file; ValueError says what is wrong with it.

    Some files of ModelNet40 have the counts glued to the word OFF, copies of it are about without the word, and one of
    them holds nothing but vertices: their convex hull, noted in the mesh's metadata as "source_note".
    """
    lines = [line.partition("#")[0].strip() for line in data.decode("utf-8", "replace").splitlines()]
    lines = [line for line in lines if line]
    header = HEADER.fullmatch(lines[0]) if lines else None
    if header:
        lines = [header[1].strip(), *lines[1:]] if header[1].strip() else lines[1:]
    elif not _integers(lines[:1]):
        return _hull(lines)
    if not _integers(lines):
        raise ValueError("no counts of vertices and faces after OFF")
    count, faces = (int(word) for word in lines[0].split()[:2])
    found = len(lines) - 1
    if found < count + faces:
        raise ValueError(f"cut short: {count} vertices and {faces} faces declared, {found} lines of them there")
    vertices = np.array([line.split()[:3] for line in lines[1 : 1 + count]], dtype=np.float64).reshape(-1, 3)
    polygons = [_corners(line) for line in lines[1 + count : 1 + count + faces]]
    return trimesh.Trimesh(vertices, triangles(vertices, polygons), process=False)


def _integers(lines: list[str]) -> bool:
    """Whether the first line holds the counts of vertices and faces, and perhaps of edges."""
    return bool(lines) and re.fullmatch(r"\d+\s+\d+(\s+\d+)?", lines[0]) is not None


def _corners(line: str) -> list[int]:
    """The corners of a face: how many they are, which vertices, and perhaps a colour."""
    words = line.split()
    corners = [int(word) for word in words[1 : int(words[0]) + 1]]
    if len(corners) < int(words[0]):
        raise ValueError(f"cut short: a face says {line!r}")
    return corners


def _hull(lines: list[str]) -> trimesh.Trimesh:
    """The convex hull of lines of three coordinates each."""
    try:
        points = np.array([line.split() for line in lines], dtype=np.float64)
    except ValueError:
        points = np.empty(0)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < MIN_POINTS:
        raise ValueError("starts neither with OFF nor with counts, and is no list of points")
    mesh = trimesh.convex.convex_hull(points)
    mesh.metadata["source_note"] = POINTS_NOTE
    return mesh
