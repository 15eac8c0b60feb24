"""The simulated camera: shadows as geometry has them, and every disturbance as large as its key says."""

import dataclasses

import numpy as np
import pytest
import torch

from graspfn.imaging.camera import Camera
from graspfn.imaging.network_input import INPUT_SHAPE
from graspfn.learning.sensor import STEP_M, View, eyes, in_view, lit, sense, smooth
from graspfn.params import Noise

torch.set_num_threads(1)
VIEW = View.of(Camera.of_the_paper(640, 480, 570.0))
NONE = Noise(0.0, 0.0)
V, U = (((np.arange(n) - (n - 1) / 2) * STEP_M) for n in INPUT_SHAPE)
V = V[:, None]


def box(u=0.0, v=0.0, size=(0.06, 0.04), height=0.08):
    inside = (np.abs(U - u) < size[0] / 2) & (np.abs(V - v) < size[1] / 2)
    return torch.from_numpy(np.where(inside, height, 0).astype(np.float32))[None]


def sensed(heights, count, **amounts):
    """count draws of one map, under one disturbance: heights (count, 132, 176) and seen."""
    noise = dataclasses.replace(NONE, **amounts)
    heights, seen = sense(heights.expand(count, -1, -1), torch.arange(count), noise, VIEW)
    return heights.numpy(), seen.numpy()


def test_nothing_wrong_leaves_the_map_as_it_is():
    heights = box(0.1, 0.05)
    measured, seen = sensed(heights, 2)
    assert np.array_equal(measured[0], np.where(seen[0], heights[0], 0))
    assert seen[0].mean() > 0.98
    assert np.array_equal(measured[0], measured[1])


@pytest.mark.parametrize("eye", [(0.0, 0.0, 0.407), (-0.139, 0.0, 0.383), (0.1, -0.08, 0.4), (0.15, 0.12, 0.36)])
@pytest.mark.parametrize(("u", "v", "height"), [(0.12, 0.0, 0.08), (-0.05, 0.09, 0.03), (0.0, -0.06, 0.15)])
def test_the_shadow_of_a_box_is_that_of_geometry_to_a_cell(eye, u, v, height):
    """A point of the table is hidden where the line to the eye meets the box: h / (H - h) times further out."""
    heights = box(u, v, height=height)
    hidden = ~lit(heights, torch.tensor([eye], dtype=torch.float64))[0].numpy()
    inside = heights[0].numpy() > 0
    along = np.linspace(0, height / eye[2], 200)[:, None, None]  # of the line from the table to the box's height
    there_u, there_v = U + along * (eye[0] - U), V + along * (eye[1] - V)

    def shadow(grown):
        meets = (np.abs(there_u - u) < 0.03 + grown) & (np.abs(there_v - v) < 0.02 + grown)
        return meets.any(axis=0) & ~inside

    stretch = STEP_M * eye[2] / (eye[2] - height)  # what a cell of the edge becomes on the table
    assert not (hidden & ~shadow(stretch)).any()
    assert not (shadow(-stretch) & ~hidden).any()
    assert not hidden[inside].any()


def test_a_flat_table_hides_nothing():
    assert lit(torch.zeros(1, *INPUT_SHAPE), torch.tensor([[0.05, -0.1, 0.4]])).all()


@pytest.mark.parametrize(("tilt", "direction"), [(0.0, 0.0), (15.0, 0.0), (20.0, 2.0), (10.0, 4.0)])
def test_in_view_is_what_the_pinhole_projects_into_its_image(tilt, direction):
    t, a, away = np.radians(tilt), direction, 0.38
    towards = np.array([np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)])
    heights = box(0.15, 0.1)
    seen = in_view(heights, torch.from_numpy(away * towards)[None], VIEW)[0].numpy()
    # Rodrigues: the turn about the horizontal axis that takes straight up to `towards`.
    k = np.array([-np.sin(a), np.cos(a), 0])
    K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    R = np.eye(3) + np.sin(t) * K + (1 - np.cos(t)) * K @ K
    points = np.stack([U + 0 * V, V + 0 * U, heights[0].numpy()], axis=-1) - away * towards
    x, y, z = np.moveaxis(points @ R, -1, 0)
    pixels = 570 * np.abs(np.stack([x / -z, y / -z])) - np.array([320, 240])[:, None, None]
    clear = np.abs(pixels).min(axis=0) > 1e-3
    assert np.array_equal(seen[clear], (pixels < 0).all(axis=0)[clear])
    assert 0.5 < seen.mean() < 1


def test_cameras_stand_within_their_limits():
    noise = dataclasses.replace(NONE, camera_tilt_deg=20.0, camera_height_mm=15.0, baseline_mm=50.0)
    camera, projector = (part.numpy() for part in eyes(torch.arange(2000), noise, VIEW))
    away = np.linalg.norm(camera, axis=1)
    tilt = np.degrees(np.arccos(camera[:, 2] / away))
    apart = np.linalg.norm(projector - camera, axis=1)
    for values, low, high in ((away, VIEW.height_m - 0.015, VIEW.height_m + 0.015), (tilt, 0, 20), (apart, 0, 0.05)):
        assert low - 1e-9 <= values.min() < low + 0.02 * (high - low)
        assert high - 0.02 * (high - low) < values.max() <= high + 1e-9
        assert values.mean() == pytest.approx((low + high) / 2, abs=0.05 * (high - low))
    assert np.abs(camera[:, :2].mean(axis=0)).max() < 0.01


def test_a_baseline_hides_what_the_projector_does_not_reach():
    heights = box(height=0.06)
    alone, pairs = sensed(heights, 40)[1], sensed(heights, 40, baseline_mm=75.0)[1]
    assert not (pairs & ~alone).any()
    bands = (alone & ~pairs).sum(axis=(1, 2))
    # At most 75 mm * 60 / 347 = 13 mm beside the box, along two sides of it and round a corner.
    most = (13 * (60 + 40) + 13**2) / 2.5**2
    assert 0.5 * most < bands.max() < 1.2 * most


def test_eq_2_is_averaged_over_the_pixels_of_a_cell():
    """3.5 x 3.5 pixels on the table, more on what stands nearer to the camera."""
    heights = box(height=0.1)
    measured, _ = sensed(heights, 100, sigma_d_mm=1.5)
    top = heights[0].numpy() > 0
    spread = 1000 * measured.std(axis=0)
    assert spread[:10].mean() == pytest.approx(1.5 / 3.5, rel=0.02)
    assert spread[top].mean() == pytest.approx(1.5 / 3.5 * (407.14 - 100) / 407.14, rel=0.02)


def test_the_table_is_off_by_an_offset_and_a_slope():
    measured, seen = sensed(torch.zeros(1, *INPUT_SHAPE), 200, table_offset_mm=2.0, table_tilt_deg=0.5)
    assert seen.all()
    offset = measured.mean(axis=(1, 2))
    slope = (measured[:, :, -1] - measured[:, :, 0]).mean(axis=1) / (U[-1] - U[0])
    assert 1000 * offset.std() == pytest.approx(2, rel=0.15)
    assert np.degrees(slope.std()) == pytest.approx(0.5, rel=0.15)
    plane = offset[:, None, None] + slope[:, None, None] * U
    plane = plane + ((measured[:, -1] - measured[:, 0]).mean(axis=1) / (V[-1] - V[0]))[:, None, None] * V
    assert np.abs(measured - plane).max() < 1e-6


def test_waves_have_their_rms_and_are_slow():
    fields = smooth(torch.arange(100), "wave", (0.03, 0.2), torch.device("cpu")).numpy()
    assert (fields**2).mean() == pytest.approx(1, rel=0.05)
    steps = np.diff(fields, axis=2)
    assert np.abs(steps).max() < 2 * np.pi / 0.03 * STEP_M * 4  # no faster than its shortest wave
    measured, _ = sensed(torch.zeros(1, *INPUT_SHAPE), 100, wave_mm=1.5)
    rms = 1000 * np.sqrt((measured**2).mean(axis=(1, 2)))
    assert rms.mean() == pytest.approx(0.75, rel=0.2)
    assert 1.2 < rms.max() < 2.5


def test_heights_are_scaled():
    measured, _ = sensed(box(height=0.1), 100, scale=0.02)
    factor = measured[:, 66, 88] / 0.1
    assert 0.98 <= factor.min() < 0.982 and 1.018 < factor.max() <= 1.02
    assert not measured[:, :10].any()


def test_depths_come_in_steps():
    ramp = torch.from_numpy(np.broadcast_to(np.float32(0.05 * (U - U[0])), INPUT_SHAPE).copy())[None]
    measured, seen = sensed(ramp, 60, step_mm=3.0)
    error = (measured - ramp.numpy())[seen]
    assert np.abs(error).max() <= 0.0015 + 1e-6
    assert error.std() == pytest.approx(0.003 / np.sqrt(3) / np.sqrt(12), rel=0.1)  # of a step that is uniform itself
    levels = [len(np.unique(line.round(6))) for line in measured[:, 66]]
    assert min(levels) < 12  # of 22 mm


def test_tilted_cameras_tell_planes_across_their_axis_apart():
    measured, seen = sensed(torch.zeros(1, *INPUT_SHAPE), 50, step_mm=3.0, camera_tilt_deg=20.0)
    levels = [len(np.unique(line[both].round(4))) for line, both in zip(measured, seen, strict=True)]
    assert np.median(levels) > 8  # a flat table comes out as stairs, each as sloped as the camera
    assert np.abs(measured).max() < 0.0017


def test_holes_take_their_share_in_blobs_and_speckle():
    _, seen = sensed(torch.zeros(1, *INPUT_SHAPE), 150, holes=0.3)
    missing = ~seen
    share = missing.mean(axis=(1, 2))
    assert share.mean() == pytest.approx(0.15, rel=0.15)
    assert share.max() < 0.5
    beside = (missing[:, :, 1:] & missing[:, :, :-1]).mean(axis=(1, 2)) / share.clip(1e-6)
    assert (beside > 0.7).mean() > 0.1  # mostly blobs
    assert (beside < 0.4).mean() > 0.1  # mostly speckle


def test_wrong_cells_at_edges_lie_between_or_are_unseen():
    heights = box(height=0.05)
    clean_seen = sensed(heights, 1)[1][0]
    measured, seen = sensed(heights, 100, edges=0.5)
    changed = (measured != heights.numpy()) & seen
    gone = clean_seen & ~seen
    full = heights[0].numpy() > 0
    padded = np.pad(full, 1)
    views = [padded[i : i + 132, j : j + 176] for i in range(3) for j in range(3)]
    near = np.any(views, axis=0) & ~np.all(views, axis=0)
    assert not changed[:, ~near].any() and not gone[:, ~near].any()
    # A share that is uniform up to 0.5, half of it unseen.
    assert gone[:, near & clean_seen].mean() == pytest.approx(0.125, rel=0.15)
    assert changed[:, near & clean_seen].mean() == pytest.approx(0.125, rel=0.15)
    assert (measured[changed] > 0).all() and (measured[changed] < 0.05).all()


def test_specks_are_few_and_of_any_height():
    measured, _ = sensed(torch.zeros(1, *INPUT_SHAPE), 100, specks=0.004)
    specks = measured > 0
    assert specks.mean() == pytest.approx(0.002, rel=0.15)
    assert measured[specks].mean() == pytest.approx(0.05, rel=0.05)
    assert measured.max() <= 0.1


def test_clutter_stands_at_the_border_and_apart_from_the_object():
    heights = box(0.12, 0.08)
    measured, _ = sensed(heights, 120, clutter=0.5)
    other = (measured > 0.001) & (heights.numpy() == 0)
    some = other.any(axis=(1, 2))
    assert 0.25 < some.mean() < 0.5  # fewer than their share: some would have stood too near
    middle = other[:, 24:-24, 24:-24]  # 8 cm across at most, half of it inside
    assert not middle.any()
    object_u, object_v = np.abs(U - 0.12).clip(0.03) - 0.03, np.abs(V - 0.08).clip(0.02) - 0.02
    assert not other[:, np.hypot(object_u, object_v) < 0.045].any()


def test_what_a_seed_draws_depends_on_no_other():
    noise = Noise(1.0, 1.5, 20.0, 20.0, 75.0, 1.0, 0.3, 1.5, 0.02, 3.0, 0.3, 0.5, 0.002, 0.9)
    heights = torch.cat([box(), box(0.1, 0.05, height=0.15), box(-0.1)])
    seeds = torch.tensor([5, 2**32 - 1, 9])
    together = sense(heights, seeds, noise, VIEW)
    for i in range(3):
        alone = sense(heights[i : i + 1], seeds[i : i + 1], noise, VIEW)
        assert torch.equal(alone[0][0], together[0][i]) and torch.equal(alone[1][0], together[1][i])
