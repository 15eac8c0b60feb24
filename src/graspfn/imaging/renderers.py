"""Which way depth images are rendered."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh

from graspfn.imaging.camera import Camera
from graspfn.imaging.render import render_depth

Renderer = Callable[[trimesh.Trimesh, np.ndarray, Camera], np.ndarray]


def renderer(name: str) -> Renderer:
    """The function that renders depth images for `camera.renderer`: embree or opengl."""
    if name == "embree":
        return render_depth
    from graspfn.imaging.opengl import render_depth_opengl  # an optional extra

    return render_depth_opengl
