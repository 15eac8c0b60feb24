"""Mesh files in a directory or in a zip archive, which is read member by member and never unpacked."""

from __future__ import annotations

import lzma
import re
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

import trimesh

from graspfn.formats.known import SUFFIXES
from graspfn.formats.reading import parse_mesh, read_mesh
from graspfn.meshes.errors import MeshError, RejectedMeshError

MAX_BYTES = 10**9  # of one mesh in an archive: a small zip can claim terabytes
DAMAGE = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError, RuntimeError)  # Runtime: encrypted


class Directory:
    """The mesh files under a directory, however deep."""

    def __init__(self, root: Path):
        paths = (path for path in root.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file())
        self.root = root
        self.names = _meshes(path.relative_to(root).as_posix() for path in paths)

    def load(self, name: str) -> trimesh.Trimesh:
        return read_mesh(self.root / name)


class Zip:
    """The mesh files in a zip archive; MeshError where it is none, or where a name in it leads outside."""

    def __init__(self, root: Path):
        try:
            self._archive = zipfile.ZipFile(root)
        except (*DAMAGE, ValueError) as error:
            raise MeshError(f"{root}: cannot be read as .zip ({error}); it takes a whole zip archive") from None
        self.root = root
        check_names(root, (member.orig_filename for member in self._archive.infolist()))
        self.names = _meshes(self._archive.namelist())

    def load(self, name: str) -> trimesh.Trimesh:
        where = f"{self.root}/{name}"
        member = self._archive.getinfo(name)
        if member.file_size > MAX_BYTES:
            raise RejectedMeshError(f"{where}: {member.file_size / 1e9:.1f} GB unpacked; a mesh takes at most 1 GB")
        try:
            data = self._archive.read(member)  # no more than file_size, whatever the compressed data hold
        except DAMAGE as error:
            raise RejectedMeshError(f"{where}: damaged in the archive ({error})") from None
        return parse_mesh(data, where)


def files_of(root: Path) -> Directory | Zip:
    """What `meshes.folder` names; MeshError where it is neither directory nor archive, or has no mesh in it."""
    takes = f"meshes.folder takes a directory or .zip of {' '.join(SUFFIXES)} files"
    if not root.exists():
        raise MeshError(f"{root}: no such file or folder; {takes}")
    files = Directory(root) if root.is_dir() else Zip(root)
    if not files.names:
        raise MeshError(f"{root}: no mesh in it; {takes}")
    return files


def check_names(archive: Path, names: Iterable[str]) -> None:
    """MeshError for a name that would leave the folder into which its archive is unpacked, on any system."""
    for name in names:
        if name.startswith("/") or ".." in name.split("/") or "\\" in name or re.match("[A-Za-z]:", name):
            raise MeshError(f"{archive}: {name!r} in it leads elsewhere; it takes plain paths inside the archive")


def _meshes(names: Iterable[str]) -> list[str]:
    """The mesh files among them, sorted; hidden ones and what macOS adds to a zip are none."""
    return sorted(name for name in set(names) if PurePosixPath(name).suffix.lower() in SUFFIXES and not _hidden(name))


def _hidden(name: str) -> bool:
    return any(part.startswith(".") or part == "__MACOSX" for part in PurePosixPath(name).parts)
