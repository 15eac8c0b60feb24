"""Depth images of shapes whose depth is known, and of the same scene by OpenGL."""

import numpy as np
import pytest
import trimesh
from trimesh.transformations import random_rotation_matrix

from graspfn.geometry.transforms import T_world_scene, rotation_z, translation
from graspfn.imaging import opengl
from graspfn.imaging.camera import NEAR_M, Camera
from graspfn.imaging.opengl import OpenGLError, render_depth_opengl
from graspfn.imaging.render import render_depth
from graspfn.imaging.warp import move_image

CAMERA = Camera.of_the_paper(640, 480, 570.0)
TABLE = CAMERA.table_depth


def tumbled(mesh, seed):
    """A pose in which the mesh rests its lowest vertex on the table, off the image's centre."""
    T = random_rotation_matrix(np.random.default_rng(seed).random(3))
    return translation(0.03, -0.04, -(mesh.vertices @ T[:3, :3].T)[:, 2].min()) @ T


def test_empty_table_where_the_object_is_out_of_view():
    depth = render_depth(trimesh.creation.icosphere(), translation(30, 0), CAMERA)
    assert depth.shape == (480, 640)
    assert depth.dtype == np.float32
    assert (depth == np.float32(TABLE)).all()


def test_box_covers_the_pixels_and_depths_of_a_pinhole():
    depth = render_depth(trimesh.creation.box((0.08, 0.04, 0.06)), translation(0, 0, 0.03), CAMERA)
    top = TABLE - 0.06
    half = CAMERA.K[0] * np.array([0.04, 0.02]) / top
    rows, columns = np.mgrid[:480, :640]
    inside = (abs(columns - 319.5) < half[0]) & (abs(rows - 239.5) < half[1])
    assert np.allclose(depth[inside], top, atol=1e-6)
    assert np.allclose(depth[~inside], TABLE)


def test_sphere_has_the_depth_of_the_closed_form():
    radius, z = 0.05, 0.05
    depth = render_depth(trimesh.creation.icosphere(6, radius), translation(0.02, 0.03, z), CAMERA)
    ray = CAMERA.rays()
    ray_length = np.linalg.norm(ray, axis=-1)
    to_centre = np.array([0.02, 0.03, z - TABLE])
    along = ray @ to_centre / ray_length
    miss = to_centre @ to_centre - along**2
    seen = miss < (0.95 * radius) ** 2
    expected = (along - np.sqrt(np.where(seen, radius**2 - miss, 0))) / ray_length
    assert np.abs(depth - expected)[seen].max() < 1e-4  # the mesh's facets cut at most 0.02 mm off


def test_object_to_the_upper_right_is_seen_there():
    """World +y is up in the image."""
    depth = render_depth(trimesh.creation.box((0.02, 0.02, 0.02)), translation(0.1, 0.05, 0.01), CAMERA)
    rows, columns = np.nonzero(depth < TABLE - 0.001)
    assert columns.min() > 320
    assert rows.max() < 240


def test_turning_the_object_turns_the_image():
    mesh = trimesh.creation.capsule(0.08, 0.02)
    T = tumbled(mesh, 1)
    turned = render_depth(mesh, T_world_scene(np.zeros(2), 1.1) @ T, CAMERA)
    expected = move_image(render_depth(mesh, T, CAMERA), np.zeros(2), 1.1, CAMERA, TABLE)
    assert np.median(np.abs(turned - expected)[turned < TABLE - 0.001]) < 1e-4
    assert (np.abs(turned - expected) > 0.002).mean() < 0.003  # outlines, where interpolation mixes depths


def test_what_is_nearer_than_the_near_plane_is_not_seen():
    """A column that passes through the camera's height: no nonsense depth, and the table around it is still there."""
    beside = render_depth(trimesh.creation.box((0.02, 0.02, 1.2)), translation(0.06, 0, 0.6), CAMERA)
    assert np.isfinite(beside).all()
    assert beside.min() >= NEAR_M
    assert np.allclose(beside[:, :320], TABLE)
    assert (beside[240, 400:] < TABLE).all()  # the side of the column hides the table behind it
    above = render_depth(trimesh.creation.box((0.1, 0.1, 0.1)), translation(0, 0, TABLE + 0.1), CAMERA)
    assert np.allclose(above, TABLE)


def test_below_the_table_is_not_seen():
    depth = render_depth(trimesh.creation.box((0.1, 0.1, 0.04)), translation(0, 0, -0.05), CAMERA)
    assert np.allclose(depth, TABLE)


def test_camera_scale_follows_the_focal_length():
    near = Camera.of_the_paper(640, 480, 300.0)
    depth = render_depth(trimesh.creation.box((0.1, 0.1, 0.001)), translation(0, 0, 0.0005), near)
    assert (depth < near.table_depth - 0.0005).sum() == pytest.approx(140 * 140, rel=0.02)  # 14 px are 10 mm


@pytest.fixture(scope="module")
def egl():
    try:
        opengl._context()
    except OpenGLError as error:
        pytest.skip(str(error))


MESHES = {
    "box": trimesh.creation.box((0.2, 0.1, 0.05)),
    "torus": trimesh.creation.torus(0.06, 0.02),
    "sphere": trimesh.creation.icosphere(4, 0.08),
    "column past the camera": trimesh.creation.box((0.03, 0.03, 1.0)),
}


@pytest.mark.parametrize("name", MESHES)
def test_opengl_renders_the_same_image(egl, name):
    """Apart from single pixels on an outline, where the two round differently."""
    mesh = MESHES[name]
    T = tumbled(mesh, len(name))
    difference = np.abs(render_depth(mesh, T, CAMERA) - render_depth_opengl(mesh, T, CAMERA))
    assert (difference > 2e-5).sum() <= 10


def test_opengl_missing_is_one_line(monkeypatch):
    opengl._context.cache_clear()
    monkeypatch.setitem(__import__("sys").modules, "moderngl", None)
    with pytest.raises(OpenGLError, match=r"^camera.renderer: opengl needs moderngl .*$"):
        render_depth_opengl(MESHES["box"], rotation_z(0), CAMERA)
