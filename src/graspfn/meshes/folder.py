"""Meshes of a directory: ModelNet40 as downloaded, or any folder of files that trimesh reads."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh

from graspfn.meshes.errors import MeshError
from graspfn.workflow.seeds import seed_of

SUFFIXES = (".off", ".obj", ".stl", ".ply", ".glb", ".gltf")
SPLITS = ("train", "test")  # ModelNet's own split: folders that are no class


class Folder:
    """Every mesh file under `root`, however deep; its class is the folder that holds it."""

    name = "folder"

    def __init__(self, root: Path):
        if not root.is_dir():
            raise MeshError(f"{root}: no such folder; meshes.folder takes a directory of {' '.join(SUFFIXES)} files")
        files = [path for path in root.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file()]
        if not files:
            raise MeshError(f"{root}: no mesh in it; meshes.folder takes a directory of {' '.join(SUFFIXES)} files")
        for path in sorted(files):
            if path.stat().st_size == 0:
                raise MeshError(f"{path}: empty file; take it out, or put back the mesh that it was")
        self.root = root
        self.names = sorted(path.relative_to(root).as_posix() for path in files)
        self.count = float(len(files))

    def candidates(self, split: str, seed: int) -> Iterator[tuple[str, str]]:
        """In an order drawn from the seed, that a file more or less in the folder leaves as it is."""
        order = sorted(self.names, key=lambda name: seed_of(seed, "select_meshes", name))
        for name in order if split == "train" else reversed(order):
            yield name, class_of(name)

    def load(self, name: str, rng: np.random.Generator) -> trimesh.Trimesh:
        """The mesh of a file; `rng` is not needed, since a file holds one mesh."""
        return read_mesh(self.root / name)

    def id(self, name: str, shape: str) -> str:
        """folder-bed_0001-9f1c22ab: the shape tells files of equal names apart."""
        stem = re.sub(r"[^A-Za-z0-9_.]+", "_", Path(name).stem)
        return f"folder-{stem}-{shape[:8]}"


def class_of(name: str) -> str:
    """bed/train/bed_0001.off is a bed; a file that lies in no folder has the class ""."""
    parts = Path(name).parts[:-1]
    if parts and parts[-1] in SPLITS:
        parts = parts[:-1]
    return parts[-1] if parts else ""


def read_mesh(path: Path) -> trimesh.Trimesh:
    """The mesh of a file as it stands; MeshError where the file is missing, empty, cut short or no mesh."""
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise MeshError(f"{path}: no such file") from None
    if not data:
        raise MeshError(f"{path}: empty file; it takes a mesh")
    kind = path.suffix.lower().lstrip(".")
    if kind == "off":
        data = _with_off_header(data, path)
    try:
        # the resolver finds the buffers that a .gltf keeps in files beside it
        resolver = trimesh.resolvers.FilePathResolver(str(path))
        mesh = trimesh.load_mesh(io.BytesIO(data), file_type=kind, process=False, resolver=resolver)
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    except Exception as error:  # every reader of trimesh fails in its own way on a damaged file
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise MeshError(f"{path}: cannot be read as .{kind} ({reason}); it takes a whole mesh file") from None
    if faces.ndim != 2 or len(faces) == 0:
        raise MeshError(f"{path}: no faces in it; it takes a surface mesh, not points or curves")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise MeshError(f"{path}: a face names a vertex that is not there; it takes a whole mesh file")
    return mesh


def _with_off_header(data: bytes, path: Path) -> bytes:
    """An OFF file whose counts follow 'OFF' on a line of their own.

    Some files of ModelNet40 have the counts glued to the word, and copies of it are about without the word.
    """
    data = data.lstrip()
    first = data.split(b"\n", 1)[0].split()
    if first and first[0][:3].upper() == b"OFF":
        return b"OFF\n" + data[3:]
    if len(first) in (2, 3) and all(word.isdigit() for word in first):
        return b"OFF\n" + data
    if first and first[0].endswith(b"OFF"):  # COFF, NOFF: with colours, with normals
        return data
    raise MeshError(f"{path}: no OFF file: its first line is neither 'OFF' nor the counts of vertices and faces")
