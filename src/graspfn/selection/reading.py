"""One mesh from the bytes of one file, or the reason why not."""

from __future__ import annotations

import io
import re
from pathlib import Path, PurePosixPath

import numpy as np
import trimesh

from graspfn.meshes.errors import MeshError, RejectedMeshError
from graspfn.selection.off import read_off

SUFFIXES = (".off", ".obj", ".stl", ".ply", ".glb", ".gltf")


def read_mesh(path: Path) -> trimesh.Trimesh:
    """The mesh of a file as it stands, in its own units.

    MeshError where there is no such file, RejectedMeshError where it is empty, cut short or no mesh.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise MeshError(f"{path}: no such file") from None
    except OSError as error:
        raise RejectedMeshError(f"{path}: cannot be read ({error.strerror})") from None
    # the resolver finds the buffers that a .gltf keeps in files beside it
    return parse_mesh(data, str(path), trimesh.resolvers.FilePathResolver(str(path)))


def parse_mesh(data: bytes, where: str, resolver: trimesh.resolvers.Resolver | None = None) -> trimesh.Trimesh:
    """The mesh that the bytes of a file hold; `where` names it in messages, and its suffix is the format.

    Raises RejectedMeshError. (An .obj that is cut short between two faces looks whole, since it declares no counts.)
    """
    if not data:
        raise RejectedMeshError(f"{where}: empty file; it takes a mesh")
    kind = PurePosixPath(where).suffix.lower().lstrip(".")
    try:
        mesh = read_off(data) if kind == "off" else _load(data, kind, resolver)
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        if kind == "ply":
            _check_ply_counts(data, len(vertices), len(faces))
    except Exception as error:  # every reader of trimesh fails in its own way on a damaged file
        reason = str(error)[:120] or type(error).__name__
        raise RejectedMeshError(f"{where}: cannot be read as .{kind} ({reason}); it takes a whole mesh file") from None
    if faces.ndim != 2 or len(faces) == 0:
        raise RejectedMeshError(f"{where}: no faces in it; it takes a whole surface mesh, not points or curves")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise RejectedMeshError(f"{where}: a face names a vertex that is not there; it takes a whole mesh file")
    return mesh


def _load(data: bytes, kind: str, resolver: trimesh.resolvers.Resolver | None) -> trimesh.Trimesh:
    """By trimesh; materials are left out, lest a missing picture cost a mesh."""
    options = {"skip_materials": True} if kind in ("obj", "ply") else {}
    return trimesh.load_mesh(io.BytesIO(data), file_type=kind, process=False, resolver=resolver, **options)


def _check_ply_counts(data: bytes, vertices: int, faces: int) -> None:
    """ValueError where a PLY holds less than its header declares; trimesh takes what there is of a text one."""
    header = data.partition(b"end_header")[0]
    for element, found in (("vertex", vertices), ("face", faces)):
        declared = re.search(rb"^element\s+" + element.encode() + rb"\s+(\d+)", header, re.MULTILINE)
        if declared and found < int(declared[1]):
            raise ValueError(f"cut short: {found} of {int(declared[1])} {element} lines there")
