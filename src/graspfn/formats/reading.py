"""One mesh from the bytes of one file, or the reason why not."""

from __future__ import annotations

import io
import logging
from pathlib import Path, PurePosixPath

import numpy as np
import trimesh

from graspfn.formats.known import SUFFIXES, known, plain
from graspfn.formats.obj import read_obj
from graspfn.formats.off import read_off
from graspfn.formats.ply import read_ply
from graspfn.meshes.errors import MeshError, RejectedMeshError

logging.getLogger("trimesh").addHandler(logging.NullHandler())  # else what it passes over fills a screen of stderr
READERS = {".off": read_off, ".obj": read_obj, ".ply": read_ply}  # trimesh reads the others


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
    suffix = PurePosixPath(where).suffix.lower()
    if suffix not in SUFFIXES:
        what = suffix or "a file of no suffix"
        raise RejectedMeshError(f"{where}: {what} is not read; it takes {' '.join(SUFFIXES)}")
    if not data:
        raise RejectedMeshError(f"{where}: empty file; it takes a mesh")
    try:
        mesh = READERS[suffix](plain(data)) if suffix in READERS else _load(data, suffix, resolver)
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    except Exception as error:  # every reader fails in its own way on a damaged file
        reason = known(plain(data), suffix) or str(error)[:120] or type(error).__name__
        raise RejectedMeshError(f"{where}: cannot be read as {suffix} ({reason}); it takes a whole mesh file") from None
    if faces.ndim != 2 or len(faces) == 0:
        cloud = f"{len(vertices)} points and no faces" if len(vertices) else "no faces in it"
        raise RejectedMeshError(f"{where}: {known(plain(data), suffix) or cloud}; it takes a whole surface mesh")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise RejectedMeshError(f"{where}: a face names a vertex that is not there; it takes a whole mesh file")
    return mesh


def _load(data: bytes, suffix: str, resolver: trimesh.resolvers.Resolver | None) -> trimesh.Trimesh:
    """By trimesh. (A text .stl may keep its byte-order mark; the header of a binary one may look like one.)"""
    content = io.BytesIO(plain(data) if suffix == ".gltf" else data)
    return trimesh.load_mesh(content, file_type=suffix[1:], process=False, resolver=resolver)
