"""Depth images from OpenGL's depth buffer, off screen through EGL: how the paper rendered, and a check of `render`.

Needs the extra `opengl` (moderngl) and an EGL driver; Mesa's software one will do.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import trimesh

from graspfn.geometry.camera import Intrinsics
from graspfn.geometry.transforms import apply
from graspfn.imaging.holes import NEAR_M

VERTEX_SHADER = """
#version 330
uniform mat4 projection;
in vec3 point;
void main() { gl_Position = projection * vec4(point, 1.0); }
"""
FRAGMENT_SHADER = """
#version 330
void main() {}
"""


class OpenGLError(ValueError):
    """OpenGL rendering was asked for and cannot be had."""


@functools.cache
def _context() -> Any:
    """The process's one off-screen OpenGL context."""
    try:
        import moderngl
    except ImportError:
        raise OpenGLError("camera.renderer: opengl needs moderngl (pip install 'graspfn[opengl]'); or embree") from None
    try:
        context = moderngl.create_context(standalone=True, backend="egl", require=330)  # type: ignore[arg-type]
    except Exception as error:  # moderngl raises plain Exception for a missing library, device or version
        reason = " ".join(str(error).split())
        raise OpenGLError(f"camera.renderer: opengl found no EGL ({reason}); install libegl1, or take embree") from None
    context.enable_only(moderngl.DEPTH_TEST)  # no culling: surfaces are seen from both sides
    return context


def _projection(intrinsics: Intrinsics, far: float) -> np.ndarray:
    """(4, 4) from camera coordinates (x = +u, y = +v, z down the axis) to clip coordinates.

    The principal point is the image's centre, so that x_ndc = 2 fx x / (width z) puts samples at pixel centres. v goes
    up in clip space: row 0 of the buffer, its bottom row to OpenGL, is the image's top row.
    """
    P = np.zeros((4, 4))
    P[0, 0] = 2 * intrinsics.focal / intrinsics.width
    P[1, 1] = 2 * intrinsics.focal / intrinsics.height
    P[2, 2:] = (far + NEAR_M) / (far - NEAR_M), -2 * far * NEAR_M / (far - NEAR_M)
    P[3, 2] = 1
    return P


def render_depth_opengl(mesh: trimesh.Trimesh, T_world_object: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """(480, 640) float32, metres along the optical axis: the same image as `render.render_depth`."""
    context, far = _context(), intrinsics.table_depth
    points = apply(T_world_object, mesh.vertices)[mesh.faces].reshape(-1, 3)
    points = (points - [0.0, 0.0, far]) * [1.0, -1.0, -1.0]
    program = context.program(vertex_shader=VERTEX_SHADER, fragment_shader=FRAGMENT_SHADER)
    program["projection"].write(_projection(intrinsics, far).T.astype("f4").tobytes())
    buffer = context.buffer(points.astype("f4").tobytes())
    array = context.vertex_array(program, [(buffer, "3f", "point")])
    texture = context.depth_texture((intrinsics.width, intrinsics.height))
    frame = context.framebuffer(depth_attachment=texture)
    frame.use()
    frame.clear(depth=1.0)  # the far plane is the table
    array.render()
    window_depth = np.frombuffer(texture.read(alignment=1), np.float32).reshape(intrinsics.height, intrinsics.width)
    for held in (frame, texture, array, buffer, program):
        held.release()
    ndc = 2 * window_depth.astype(float) - 1
    return (2 * far * NEAR_M / (far + NEAR_M - ndc * (far - NEAR_M))).astype(np.float32)
