"""Depth images from OpenGL's depth buffer, off screen through EGL: how the paper rendered, and a check of `render`.

Needs the extra `opengl` (moderngl) and an EGL driver; Mesa's software one will do.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import trimesh

from graspfn.geometry.transforms import apply
from graspfn.imaging.camera import NEAR_M, Camera

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


def _projection(camera: Camera, far: float) -> np.ndarray:
    """(4, 4) from camera coordinates (x right, y down, z along the axis) to clip coordinates.

    Pixel centres are whole numbers, and the image's edges half a pixel further out. y goes up in clip space: row 0 of
    the buffer, its bottom row to OpenGL, is the image's top row.
    """
    fx, fy, cx, cy = camera.K
    P = np.zeros((4, 4))
    P[0, 0], P[0, 2] = 2 * fx / camera.width, (2 * cx + 1) / camera.width - 1
    P[1, 1], P[1, 2] = 2 * fy / camera.height, (2 * cy + 1) / camera.height - 1
    P[2, 2:] = (far + NEAR_M) / (far - NEAR_M), -2 * far * NEAR_M / (far - NEAR_M)
    P[3, 2] = 1
    return P


def render_depth_opengl(mesh: trimesh.Trimesh, T_world_object: np.ndarray, camera: Camera) -> np.ndarray:
    """(height, width) float32, metres along the optical axis: the same image as `render.render_depth`."""
    if camera.distorts:
        raise OpenGLError("camera.renderer: opengl knows no lens; with camera.distortion take embree")
    context, table = _context(), camera.bare_table()
    T_camera_object = np.linalg.inv(camera.T_world_camera) @ T_world_object
    points = apply(T_camera_object, mesh.vertices)[mesh.faces].reshape(-1, 3)
    far = max(float(points[:, 2].max()), 2 * NEAR_M)
    program = context.program(vertex_shader=VERTEX_SHADER, fragment_shader=FRAGMENT_SHADER)
    program["projection"].write(_projection(camera, far).T.astype("f4").tobytes())
    buffer = context.buffer(points.astype("f4").tobytes())
    array = context.vertex_array(program, [(buffer, "3f", "point")])
    texture = context.depth_texture((camera.width, camera.height))
    frame = context.framebuffer(depth_attachment=texture)
    frame.use()
    frame.clear(depth=1.0)
    array.render()
    window_depth = np.frombuffer(texture.read(alignment=1), np.float32).reshape(camera.height, camera.width)
    for held in (frame, texture, array, buffer, program):
        held.release()
    ndc = 2 * window_depth.astype(float) - 1
    depth = 2 * far * NEAR_M / (far + NEAR_M - ndc * (far - NEAR_M))
    return np.where(window_depth < 1, np.minimum(depth, table), table).astype(np.float32)
