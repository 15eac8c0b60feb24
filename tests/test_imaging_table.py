"""The table is found in images of cameras whose pose is known badly, and refused where there is none to trust."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from test_imaging_camera import BARREL, CAMERAS, orbited

from graspfn.geometry.transforms import rotation_z, translation
from graspfn.imaging.camera import Camera, straight_down
from graspfn.imaging.noise import add_noise
from graspfn.imaging.render import render_depth
from graspfn.imaging.table import TableError, fit_table
from graspfn.params import Noise, Table

LIMITS = Table(fit=True, max_tilt_deg=20, min_inliers=0.15, max_rms_mm=3, max_offset_mm=100)
LAX = Table(fit=True, max_tilt_deg=89, min_inliers=0.01, max_rms_mm=99, max_offset_mm=1e4)
NOISE = Noise(sigma_p_px=1, sigma_d_mm=1.5)
CAMERA = Camera.of_the_paper(640, 480, 570.0)
BOX = trimesh.creation.box((0.2, 0.2, 0.15)), translation(0.02, 0.01, 0.075)  # covers half of the paper's image


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def seen(camera, rng, thing=BOX, noise=NOISE):
    return add_noise(np.nan_to_num(render_depth(*thing, camera), posinf=0), noise, rng)


@pytest.mark.parametrize("camera", [*CAMERAS.values(), BARREL], ids=[*CAMERAS, "barrel"])
@pytest.mark.parametrize("tilt", [0, 10, 19])
def test_height_and_tilt_are_found_whatever_was_believed(camera, tilt, rng):
    true = camera.at(orbited(camera.position[2], tilt, rng.uniform(0, 6)))
    wrong = straight_down(true.position[2] + rng.uniform(-0.05, 0.05))
    fit = fit_table(seen(true, rng), camera.at(wrong), LIMITS)
    assert fit.height_m == pytest.approx(true.position[2], abs=1e-4)
    assert fit.tilt_deg == pytest.approx(tilt, abs=0.1)
    assert fit.T_world_camera[2, 3] == fit.height_m
    assert np.degrees(np.arccos(np.clip(-fit.T_world_camera[2, 2], -1, 1))) == pytest.approx(fit.tilt_deg, abs=1e-6)
    assert fit.rms_m == pytest.approx(0.0015, abs=2e-4)


def test_x_y_and_yaw_stay_as_they_were_given(rng):
    """A camera that has turned about its own lens is put right."""
    true = CAMERA.at(translation(0.03, -0.02) @ rotation_z(0.4) @ straight_down(0.43))
    turn = np.eye(4)
    turn[:3, :3] = trimesh.transformations.rotation_matrix(0.06, [0.8, 0.6, 0])[:3, :3]
    wrong = true.T_world_camera.copy()
    wrong[:3, :3] = turn[:3, :3] @ wrong[:3, :3]
    wrong[2, 3] += 0.02
    fit = fit_table(seen(true, rng), CAMERA.at(wrong), LIMITS)
    np.testing.assert_array_equal(fit.T_world_camera[:2, 3], wrong[:2, 3])
    np.testing.assert_allclose(fit.T_world_camera, true.T_world_camera, atol=1e-3)


@pytest.mark.parametrize("nothing", [0.0, np.nan, np.inf, 65.535, 8.191, -1.0])
def test_what_is_no_measurement_moves_no_table(nothing, rng):
    depth = seen(CAMERA, rng)
    depth[rng.random(depth.shape) < 0.3] = nothing
    assert fit_table(depth, CAMERA, LIMITS).height_m == pytest.approx(CAMERA.position[2], abs=1e-4)


def test_the_floor_beside_the_table_is_not_the_table(rng):
    depth = seen(CAMERA, rng)
    depth[:, 380:] = 1.1 + rng.normal(0, 0.003, (480, 260))  # most of what is seen but for the box
    assert fit_table(depth, CAMERA, LIMITS).height_m == pytest.approx(CAMERA.position[2], abs=1e-4)


def test_the_same_image_is_the_same_table(rng):
    depth = seen(CAMERA, rng)
    one, other = (fit_table(depth.copy(), CAMERA, LIMITS).T_world_camera for _ in range(2))
    np.testing.assert_array_equal(one, other)


REFUSED = {
    "max_tilt_deg": (orbited(0.45, 25), "table: 25.0 degrees from under the camera; table.max_tilt_deg takes 20"),
    "max_offset_mm": (straight_down(0.55), r"table: 0.550 m under the camera, .*; table.max_offset_mm takes 100"),
}


@pytest.mark.parametrize("key", REFUSED)
def test_a_camera_beyond_the_limits_is_one_line(key, rng):
    pose, says = REFUSED[key]
    with pytest.raises(TableError, match=f"^{says}$"):
        fit_table(seen(CAMERA.at(pose), rng), CAMERA, LIMITS)
    fit_table(seen(CAMERA.at(pose), rng), CAMERA, replace(LIMITS, **{key: getattr(LAX, key)}))


def test_too_little_table_is_one_line(rng):
    with pytest.raises(TableError, match=r"^table: \d+% of what is measured; table.min_inliers takes 60%$"):
        fit_table(seen(CAMERA, rng), CAMERA, replace(LIMITS, min_inliers=0.6))


def test_a_rough_table_is_one_line(rng):
    depth = CAMERA.table_depth + rng.normal(0, 0.004, (480, 640))
    with pytest.raises(TableError, match=r"^table: (3.9|4.0) mm rms rough; table.max_rms_mm takes 3$"):
        fit_table(depth, CAMERA, LIMITS)


@pytest.mark.parametrize("nothing", [0.0, np.nan, 0.4])
def test_where_there_is_no_plane_it_is_one_line(nothing, rng):
    depth = np.full((480, 640), nothing)
    if nothing == 0.4:  # a chasm: planes have more under them than on them
        depth = np.where(np.arange(640) % 2, 0.2, 0.4) * np.ones((480, 1)) + rng.uniform(-0.1, 0.1, (480, 640))
    with pytest.raises(TableError, match=r"^(depth image|table): .*$"):
        fit_table(depth, CAMERA, LIMITS)
