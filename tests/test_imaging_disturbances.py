"""Each disturbance of a depth image is what its name says."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import trimesh
from physics_params import PARAMS
from scipy import ndimage

from graspfn.geometry.transforms import translation
from graspfn.imaging.camera import Camera
from graspfn.imaging.disturbances import CLEAN, Shot, missing, raised, shots, turned, waves
from graspfn.imaging.noise import observe
from graspfn.imaging.render import render_depth
from graspfn.imaging.table import fit_table
from graspfn.params import Noise, ParameterError, read_camera

ROOT = Path(__file__).parents[1]
CAMERA, NOTHING = Camera.from_params(PARAMS.camera), Noise(0.0, 0.0)
D435 = Camera.from_params(read_camera(ROOT / "conf/camera/realsense_d435.yaml", PARAMS.noise)[0])
BOX, AT = trimesh.creation.box((0.06, 0.09, 0.05)), translation(0.03, 0.02, 0.025)
AMOUNTS = dataclasses.replace(PARAMS.disturb, offset_mm=(-10.0, 5.0), tilt_deg=(2.0, 15.0), height_mm=(20.0,))
LEVEL = {"offset_mm", "tilt_deg", "wave_mm", "scale_percent", "holes_percent", "step_mm", "height_mm"}


def box(camera: Camera) -> np.ndarray:
    return render_depth(BOX, AT, camera)


def table(camera: Camera) -> np.ndarray:
    return camera.bare_table().astype(np.float32)


def taken(render=box, noise=NOTHING, amounts=AMOUNTS, name="box") -> dict[tuple[str, float], Shot]:
    found = shots(render, CAMERA, noise, {"d435": (D435, noise)}, amounts, 0, name)
    return {(shot.disturbance, shot.amount): shot for shot in found}


@pytest.fixture(scope="module")
def quiet() -> dict[tuple[str, float], Shot]:
    return taken()


def test_the_first_shot_is_the_image_that_trials_are_planned_on():
    first = next(shots(box, CAMERA, PARAMS.noise, {}, AMOUNTS, 0, "cup"))
    assert first.disturbance == CLEAN and first.camera is CAMERA
    np.testing.assert_array_equal(first.depth, observe(box(CAMERA), PARAMS.noise, 0, "cup"))


def test_an_amount_of_nothing_leaves_the_image_as_it_is():
    nothing = taken(noise=PARAMS.noise, amounts=dataclasses.replace(AMOUNTS, **dict.fromkeys(LEVEL, (0.0,))))
    clean = nothing[CLEAN, 0.0]
    for (name, amount), shot in nothing.items():
        if amount == 0:
            np.testing.assert_allclose(shot.depth, clean.depth, atol=1e-6, err_msg=name)
            np.testing.assert_allclose(shot.camera.T_world_camera, CAMERA.T_world_camera, atol=1e-12)


def test_other_noise_is_as_large_and_elsewhere():
    shot = taken(table, PARAMS.noise)
    errors = [shot[key].depth - table(CAMERA) for key in ((CLEAN, 0.0), ("other noise", 1.0))]
    assert np.std(errors, axis=(1, 2)) == pytest.approx([0.0015] * 2, rel=0.02)
    assert abs(np.corrcoef(errors[0].ravel(), errors[1].ravel())[0, 1]) < 0.01


def test_offset_and_height_move_the_camera_and_only_height_is_known(quiet):
    for mm in (-10.0, 5.0):
        shot = quiet["offset", mm]
        np.testing.assert_array_equal(shot.depth, box(raised(CAMERA, mm / 1000)))
        assert shot.camera.table_depth == CAMERA.table_depth
        assert shot.depth.max() == pytest.approx(CAMERA.table_depth + mm / 1000, abs=1e-6)
    shot = quiet["camera height", 20.0]
    assert shot.camera.table_depth == pytest.approx(CAMERA.table_depth + 0.02)
    np.testing.assert_array_equal(shot.depth, box(shot.camera))


@pytest.mark.parametrize("degrees", [2.0, 15.0])
def test_tilt_is_unknown_and_the_middle_of_q_stays_in_sight(quiet, degrees):
    shot = quiet["tilt", degrees]
    assert shot.camera.tilt == pytest.approx(0)
    fit = fit_table(shot.depth, shot.camera, PARAMS.table)
    assert fit.tilt_deg == pytest.approx(degrees, abs=0.05)
    true = CAMERA.at(fit.T_world_camera)
    np.testing.assert_allclose(true.table_to_pixel(np.zeros(2)), CAMERA.centre, atol=1)
    assert np.linalg.norm(true.position) == pytest.approx(CAMERA.table_depth, rel=1e-3)
    np.testing.assert_allclose(box(true), shot.depth, atol=0.002 + 0.1 * (ndimage.sobel(shot.depth) > 0.01).max())


def test_a_camera_is_turned_towards_a_direction_by_an_angle():
    towards = turned(CAMERA, 0.2, 0.7)
    assert towards.tilt == pytest.approx(0.2)
    flat = towards.position[:2] / np.linalg.norm(towards.position[:2])
    np.testing.assert_allclose(flat, [np.cos(0.7), np.sin(0.7)], atol=1e-12)


def test_waves_are_smooth_and_as_high_as_said(quiet):
    errors = {mm: quiet["waviness", mm].depth - quiet[CLEAN, 0.0].depth for mm in AMOUNTS.wave_mm}
    for mm, error in errors.items():
        assert error.std() == pytest.approx(mm / 1000, rel=1e-3) and abs(error.mean()) < 1e-7
        steps = np.abs(np.diff(error, axis=1)).max()
        assert steps < 3 * mm / 1000 * 2 * np.pi / 0.03 * CAMERA.table_depth / CAMERA.K[0]  # the shortest wave's slope
    np.testing.assert_allclose(errors[2.0], 2 * errors[1.0], atol=2e-7)  # in the same places
    others = waves(CAMERA, (0.03, 0.2), np.random.default_rng(1)), waves(CAMERA, (0.03, 0.2), np.random.default_rng(2))
    assert not np.allclose(*others)


def test_scale_is_a_share_of_depth_and_steps_are_whole(quiet):
    clean = quiet[CLEAN, 0.0].depth
    for percent in AMOUNTS.scale_percent:
        np.testing.assert_allclose(quiet["scale", percent].depth / clean, 1 + percent / 100, rtol=1e-6)
    for mm in AMOUNTS.step_mm:
        depth = quiet["quantisation", mm].depth
        whole = depth / (mm / 1000)
        np.testing.assert_allclose(whole, np.round(whole), atol=1e-3)
        assert np.abs(depth - clean).max() <= mm / 2000 + 1e-6


def test_holes_are_as_many_as_said_in_blobs_and_alone(quiet):
    before = np.zeros(quiet[CLEAN, 0.0].depth.shape, bool)
    for percent in AMOUNTS.holes_percent:
        shot = quiet["holes", percent]
        holes = np.isnan(shot.depth)
        assert holes.mean() == pytest.approx(percent / 100, abs=0.005)
        assert not (before & ~holes).any()  # more holes are the same and more
        np.testing.assert_array_equal(shot.depth[~holes], quiet[CLEAN, 0.0].depth[~holes])
        blobs = ndimage.binary_opening(holes, np.ones((7, 7)), iterations=1).mean()
        assert percent / 200 * 0.7 < blobs < percent / 100
        before = holes
    assert not missing(CAMERA, np.random.default_rng(0))(0.0).any()


def test_another_camera_sees_the_same_scene_from_its_own_place(quiet):
    (shot,) = (shot for (name, _), shot in quiet.items() if name == "camera d435")
    assert shot.depth.shape == (480, 848) and shot.amount == 450 and shot.camera is D435
    np.testing.assert_array_equal(shot.depth, box(D435))


@pytest.mark.parametrize("name", PARAMS.disturb.cameras)
def test_other_cameras_see_all_of_q(name):
    camera, noise = read_camera(ROOT / f"conf/camera/{name}.yaml", PARAMS.noise)
    corners = Camera.from_params(camera).table_to_pixel(np.array([[-0.22, -0.165], [0.22, -0.165], [0.22, 0.165]]))
    assert (corners >= 0).all() and (corners <= [camera.width_px - 1, camera.height_px - 1]).all()
    assert noise.holes == PARAMS.noise.holes


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "no such file"),
        ("noise: {}", "takes a mapping with the key camera"),
        ("camera: {width_px: 640}", "camera.height_px: missing"),
        ("camera: 5", "camera: takes a mapping"),
    ],
)
def test_a_bad_camera_is_one_line(tmp_path, text, says):
    path = tmp_path / "mine.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ParameterError, match=says) as caught:
        read_camera(path, PARAMS.noise)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)
