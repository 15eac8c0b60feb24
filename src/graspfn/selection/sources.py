"""Where meshes come from, by the name that `meshes.source` gives (docs/objects.md).

A further source is one more file and one entry here.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from graspfn.params import Meshes
from graspfn.selection.candidate import Source
from graspfn.selection.folder import Folder
from graspfn.selection.modelnet import ModelNet
from graspfn.selection.packages import RANDOM_URDFS, RGB_OBJECTS, YCB, Packaged
from graspfn.selection.procedural import Procedural
from graspfn.selection.union import Union


def _open_objects() -> Union:
    """All that needs no licence click, by turns with generated objects."""
    return Union("open_objects", [Packaged(RGB_OBJECTS), Packaged(RANDOM_URDFS), Packaged(YCB)], Procedural())


SOURCES: dict[str, Callable[[Meshes], Source]] = {
    "procedural": lambda meshes: Procedural(),
    "open_objects": lambda meshes: _open_objects(),
    "rgb_objects": lambda meshes: Packaged(RGB_OBJECTS),
    "random_urdfs": lambda meshes: Packaged(RANDOM_URDFS),
    "ycb": lambda meshes: Packaged(YCB),
    "modelnet40": lambda meshes: ModelNet(Path(meshes.folder)),
    "folder": lambda meshes: Folder(Path(meshes.folder)),
}


def source_of(meshes: Meshes) -> Source:
    """The source that the parameters name; MeshError where it cannot be had."""
    return SOURCES[meshes.source](meshes)
