"""PLY files, text or binary: vertices and faces; colours, normals, textures and other elements are passed over."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh

from graspfn.formats.polygons import triangles

TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    "int64": "i8",
    "uint64": "u8",
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
HEADER = re.compile(rb"\s*ply\s*\n(.*?)^\s*end_header[ \t]*\r?\n", re.DOTALL | re.MULTILINE)
INDICES = ("vertex_indices", "vertex_index")


@dataclass
class _Element:
    """A list of things in the file: vertices, faces, or something else."""

    name: str
    count: int
    # by name: the type of a value and, of a list, that of its length
    properties: dict[str, tuple[np.dtype, np.dtype | None]] = field(default_factory=dict)


def read_ply(data: bytes) -> trimesh.Trimesh:
    """The mesh of a PLY file, its vertices as they stand there; ValueError says what is wrong with it.

    (trimesh parts vertices where textures meet, reads no binary file whose faces differ in their corners, and takes
    what there is of a text file that is cut short.)
    """
    header = HEADER.match(data)
    if not header:
        raise ValueError("no header of a PLY file, from ply to end_header")
    form, elements = _declared(header[1].decode("utf-8", "replace"))
    body = data[header.end() :]
    if form == "ascii":  # as if it were a binary one in which all numbers are doubles
        body = np.array(body.split(), dtype=np.float64).tobytes()
    values: dict[str, dict[str, list[np.ndarray] | np.ndarray]] = {}
    offset = 0
    for element in elements:
        values[element.name], offset = _read(element, body, offset)
    if offset < len(body):
        raise ValueError("there is more in it than its header declares")
    vertex, face = values.get("vertex", {}), values.get("face", {})
    if not {"x", "y", "z"} <= vertex.keys():
        raise ValueError("no vertices with x, y and z in it")
    places = np.column_stack([np.asarray(vertex[axis], dtype=np.float64) for axis in "xyz"])
    polygons = next((face[name] for name in INDICES if name in face), ())
    return trimesh.Trimesh(places, triangles(places, polygons), process=False)


def _declared(header: str) -> tuple[str, list[_Element]]:
    """The format and the elements that a header declares."""
    form, elements = "", list[_Element]()
    for line in header.splitlines():
        match line.split():
            case ["format", "ascii" | "binary_little_endian" | "binary_big_endian" as form, *_]:
                pass
            case ["element", name, count]:
                elements.append(_Element(name, int(count)))
            case ["property", "list", length, kind, name] if elements:
                elements[-1].properties[name] = _type(kind, form), _type(length, form)
            case ["property", kind, name] if elements:
                elements[-1].properties[name] = _type(kind, form), None
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise ValueError(f"the header says {line[:60]!r}")
    return form, elements


def _type(name: str, form: str) -> np.dtype:
    if name not in TYPES or not form:
        raise ValueError(f"the header says {name!r}, which is no type" if form else "the header says no format")
    if form == "ascii":
        return np.dtype("f8")
    return np.dtype(TYPES[name]).newbyteorder("<" if form == "binary_little_endian" else ">")


def _read(element: _Element, body: bytes, start: int) -> tuple[dict[str, list[np.ndarray] | np.ndarray], int]:
    """The values of each property of an element that starts at an offset, and the offset where it ends."""
    fields, end = _row(element, body, start)
    all_end = start + element.count * (end - start)
    if element.count and end > start and all_end <= len(body):  # most often lists are all as long as the first
        table = np.frombuffer(body, np.dtype(fields), element.count, start)
        lists = [name for name, (_, length) in element.properties.items() if length is not None]
        if all((table[_length(name)] == table[name].shape[1]).all() for name in lists):
            return {name: table[name] for name in element.properties}, all_end
    values: dict[str, list[np.ndarray]] = {name: [] for name in element.properties}
    for row in range(element.count):
        fields, end = _row(element, body, start)
        if end > len(body):
            raise ValueError(f"cut short: {row} of {element.count} {element.name} lines there")
        (found,) = np.frombuffer(body, np.dtype(fields), 1, start)
        for name in element.properties:
            values[name].append(found[name])
        start = end
    return dict(values), start


def _row(element: _Element, body: bytes, start: int) -> tuple[list[Any], int]:
    """The fields of numpy's record for one thing that starts at an offset, and where it ends."""
    fields: list[Any] = []
    for name, (kind, length) in element.properties.items():
        size: tuple[int, ...] = ()
        if length is not None:
            fields.append((_length(name), length))
            inside = start + length.itemsize <= len(body)
            size = (int(np.frombuffer(body, length, 1, start)[0]) if inside else 0,)
            if size[0] < 0:
                raise ValueError(f"{name} of an {element.name} has {size[0]} entries")
            start += length.itemsize
        fields.append((name, kind, size))
        start += kind.itemsize * math.prod(size)
    return fields, start


def _length(name: str) -> str:
    return f"length of {name}"
