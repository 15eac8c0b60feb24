"""OBJ files: their vertices and faces; textures, normals, materials, groups and curves are passed over."""

from __future__ import annotations

import numpy as np
import trimesh

from graspfn.formats.polygons import triangles


def read_obj(data: bytes) -> trimesh.Trimesh:
    """The mesh of an OBJ file, its vertices as they stand there; ValueError says what is wrong with it.

    (trimesh counts negative indices from the end of the file, not from the line that they stand in.)
    """
    vertices: list[list[str]] = []
    polygons: list[list[int]] = []
    for line in data.decode("utf-8", "replace").replace("\\\r\n", " ").replace("\\\n", " ").splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            if len(words) < 4:
                raise ValueError(f"cut short: a vertex says {line!r}")
            vertices.append(words[1:4])
        elif words[0] == "f":
            indices = [int(word.partition("/")[0]) for word in line.partition("#")[0].split()[1:]]
            if indices and min(indices) < 1:
                indices = [_absolute(index, len(vertices)) for index in indices]
            polygons.append([index - 1 for index in indices])
    places = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    return trimesh.Trimesh(places, triangles(places, polygons), process=False)


def _absolute(index: int, so_far: int) -> int:
    """An index that counts from 1, where -1 is the last of the vertices `so_far`."""
    if index == 0 or index < -so_far:
        raise ValueError(f"out of range: a face names vertex {index} after {so_far} of them")
    return index if index > 0 else so_far + 1 + index
