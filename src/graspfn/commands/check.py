"""`graspfn check`, and what other commands need to be well before they begin."""

from __future__ import annotations

import ctypes
import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path

from graspfn.commands.ending import LACKS_WORKFLOW, end_at
from graspfn.params import ParameterError, check_folders, read_yaml, validate

# Loaded by name, so that a missing one is told before dartpy or moderngl is imported and fails at length.
# Debian's names; libgl1 brings libX11, which dartpy loads as well.
DART_LIBRARY = ("libGL.so.1", "libgl1", "dartpy")
OPENGL_LIBRARY = ("libEGL.so.1", "libegl1", "camera.renderer: opengl")


def check() -> None:
    """Say, a line each, what is wrong with params.yaml and its folders, and which system libraries are missing."""
    end_at(problems() or _folder_problems(), 1)


def problems() -> list[str]:
    """What is wrong with params.yaml and which system libraries are missing."""
    if importlib.util.find_spec("dartpy") is None:
        return [f"dartpy: {LACKS_WORKFLOW}"]
    found = []
    libraries = [DART_LIBRARY]
    try:
        if validate(read_yaml(Path("params.yaml"))).camera.renderer == "opengl":
            libraries.append(OPENGL_LIBRARY)
    except ParameterError as error:
        found.append(str(error))
    found += [
        f"{file}: not found; {user} needs it: apt-get install {package}"
        for file, package, user in libraries
        if not _loads(file)
    ]
    return found


def _folder_problems() -> list[str]:
    """Which folders of the user's own files cannot be used, in the words of the stages that would read them."""
    params = validate(read_yaml(Path("params.yaml")))
    checks: list[Callable[[], object]] = [lambda: check_folders(params)]
    if params.meshes.source in ("folder", "modelnet40"):
        from graspfn.selection.sources import source_of  # trimesh is slow to import

        checks.append(lambda: source_of(params.meshes))
    else:
        checks.append(lambda: _watched("meshes.folder", params.meshes.folder))
    if params.robot.source == "folder":
        from graspfn.robot.described import read_table
        from graspfn.robot.read import recordings

        checks += [lambda: recordings(Path(params.robot.folder)), lambda: read_table(Path(params.robot.folder))]
    else:
        checks.append(lambda: _watched("robot.folder", params.robot.folder))
    problems = []
    for check in checks:
        try:
            check()
        except ValueError as error:  # ParameterError, MeshError, RecordingError
            problems.append(str(error))
    return problems


def _watched(key: str, folder: str) -> None:
    if not Path(folder).exists():
        raise ParameterError(f"{key}: {folder}: no such file or folder; DVC watches it even where it is not used")


def _loads(library: str) -> bool:
    """Whether the dynamic linker finds a library; elsewhere than on Linux the wheels bring their own."""
    if sys.platform != "linux":
        return True
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True
