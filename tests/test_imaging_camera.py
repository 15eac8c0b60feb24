"""A camera of any lens and pose: what a pixel sees projects back into it, and renders as what stands there."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from graspfn.compose import compose
from graspfn.geometry.transforms import T_world_scene, rotation_z, translation
from graspfn.imaging import opengl
from graspfn.imaging.camera import Camera, straight_down
from graspfn.imaging.height_map import height_map
from graspfn.imaging.opengl import OpenGLError, render_depth_opengl
from graspfn.imaging.render import render_depth
from graspfn.params import ParameterError, validate

CONF = Path(__file__).parents[1] / "conf"
CHOICES = sorted(path.stem for path in (CONF / "camera").glob("*.yaml"))


def chosen(*overrides: str) -> Camera:
    return Camera.from_params(validate(compose([*overrides, "networks=[fcn]"], CONF)).camera)


CAMERAS = {name: chosen(f"camera={name}") for name in CHOICES}
BARREL = Camera(640, 480, (500.0, 510.0, 300.0, 250.0), (-0.2, 0.05, 0.002, -0.001, 0.01), straight_down(0.45))


def orbited(height: float, tilt_deg: float, azimuth: float = 0.0) -> np.ndarray:
    """T_world_camera of a camera so far from the middle of the table, which it looks at."""
    c, s = np.cos(np.radians(tilt_deg)), np.sin(np.radians(tilt_deg))
    X = np.eye(4)
    X[1:3, 1:3] = [[c, -s], [s, c]]
    return rotation_z(azimuth) @ X @ straight_down(height)


def turned_away(camera: Camera, seed: int) -> Camera:
    """The camera somewhere over the table, looking somewhere down."""
    rng = np.random.default_rng(seed)
    T = orbited(rng.uniform(0.4, 0.8), rng.uniform(0, 40), rng.uniform(0, 6))
    return camera.at(translation(*rng.uniform(-0.1, 0.1, 2)) @ T)


@pytest.mark.parametrize("camera", [*CAMERAS.values(), BARREL], ids=[*CHOICES, "barrel"])
def test_what_a_pixel_sees_projects_back_into_it(camera: Camera) -> None:
    camera = turned_away(camera, 0)
    depth = np.random.default_rng(1).uniform(0.2, 0.9, (camera.height, camera.width))
    rows, columns = np.mgrid[: camera.height, : camera.width]
    seen = camera.project(camera.deproject(depth))
    np.testing.assert_allclose(seen, np.stack([columns, rows, depth], axis=-1), atol=1e-4)
    pixels = np.array([[0.0, 0.0], [100.5, 30.25], [camera.width - 1, camera.height - 1]])
    np.testing.assert_allclose(camera.table_to_pixel(camera.pixel_to_table(pixels)), pixels, atol=1e-4)


def test_a_lens_shifts_pixels_by_many() -> None:
    """So that the round trip above says something."""
    plain = Camera(BARREL.width, BARREL.height, BARREL.K, (), BARREL.T_world_camera)
    corner = np.array([[0.0, 0.0]])
    assert np.hypot(*(plain.table_to_pixel(BARREL.pixel_to_table(corner)) - corner)[0]) > 10


@pytest.mark.parametrize("camera", [*CAMERAS.values(), BARREL], ids=[*CHOICES, "barrel"])
@pytest.mark.parametrize("seed", range(3))
def test_every_rendered_point_lies_on_the_table_or_the_box(camera: Camera, seed: int) -> None:
    camera = turned_away(camera, seed)
    size, shift, theta = np.array([0.1, 0.06, 0.08]), np.array([0.02, -0.03]), 0.7 * seed
    T = T_world_scene(shift, theta) @ translation(0, 0, size[2] / 2)
    points = camera.deproject(render_depth(trimesh.creation.box(size), T, camera)).reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    inside = (np.abs((points - T[:3, 3]) @ T[:3, :3]) - size / 2).max(axis=1)  # 0 on the box
    assert np.minimum(np.abs(inside), np.abs(points[:, 2])).max() < 1e-5
    assert (np.abs(inside) < 1e-5).sum() > 500


def test_past_the_horizon_there_is_no_table() -> None:
    camera = Camera.of_the_paper(640, 480, 300.0)
    camera = camera.at(orbited(0.4, 75.0))
    depth = render_depth(trimesh.creation.box((0.01, 0.01, 0.01)), translation(0, 0, 0.005), camera)
    assert np.isinf(depth).any()
    assert (depth > 0).all()
    assert height_map(depth, camera).seen.any()


@pytest.mark.parametrize("name", CHOICES)
def test_every_camera_of_conf_sees_all_that_q_covers(name: str) -> None:
    camera = CAMERAS[name]
    seen = height_map(camera.bare_table(), camera)
    assert seen.seen.all()
    assert np.abs(seen.heights).max() < 1e-5


def test_opengl_renders_the_same_image_from_any_pose() -> None:
    try:
        opengl._context()
    except OpenGLError as error:
        pytest.skip(str(error))
    mesh = trimesh.creation.torus(0.06, 0.02)
    for name in ("carmine109", "realsense_d435"):
        camera = turned_away(CAMERAS[name], 2)
        one, other = (render(mesh, translation(0, 0, 0.02), camera) for render in (render_depth, render_depth_opengl))
        assert (np.abs(one - other) > 2e-5).sum() <= 20


def test_opengl_refuses_a_lens() -> None:
    with pytest.raises(OpenGLError, match=r"^camera.renderer: opengl knows no lens; .*$"):
        render_depth_opengl(trimesh.creation.box(), np.eye(4), BARREL)


POSE = [1, 0, 0, 0.1, 0, -1, 0, 0.2, 0, 0, -1, 0.5, 0, 0, 0, 1]


def test_a_pose_of_the_parameters_is_the_cameras() -> None:
    camera = chosen(f"camera.pose={POSE}")
    np.testing.assert_array_equal(camera.T_world_camera, np.reshape(POSE, (4, 4)))


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("pose", POSE[:12], "has 12 numbers; it takes the 16 of T_world_camera"),
        ("pose", [2, *POSE[1:]], "no rotation and translation"),
        ("pose", [-1, *POSE[1:]], "no rotation and translation"),  # a mirror
        ("pose", [*POSE[:12], 0, 0, 0, 2], "no rotation and translation"),
        ("pose", [*POSE[:11], -0.5, *POSE[12:]], "takes a camera that looks down"),
        ("pose", np.eye(4).ravel().tolist(), "takes a camera that looks down"),
        ("distortion", [0.1, 0.2], "takes 4, 5 or 8 numbers"),
    ],
)
def test_what_is_no_camera_is_one_line(key: str, value: list[float], says: str) -> None:
    with pytest.raises(ParameterError, match=rf"^camera\.{key}: {says}.*$"):
        chosen(f"camera.{key}={value}")
