"""The renderers by their names in camera.renderer; both give the same image."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh

from graspfn.geometry.camera import Intrinsics
from graspfn.imaging.opengl import render_depth_opengl
from graspfn.imaging.render import render_depth

RENDERERS: dict[str, Callable[[trimesh.Trimesh, np.ndarray, Intrinsics], np.ndarray]] = {
    "embree": render_depth,
    "opengl": render_depth_opengl,
}
