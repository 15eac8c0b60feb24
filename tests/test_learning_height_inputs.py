"""Inputs with heights: the moved map of the moved object, exactly, and batches that are no more than their lines."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
import torch
import trimesh
from scipy import ndimage

from graspfn.geometry.transforms import T_world_scene, translation
from graspfn.imaging.camera import Camera
from graspfn.imaging.height_map import TABLE_M, height_map
from graspfn.imaging.noise import add_noise
from graspfn.imaging.orthographic import render_heights
from graspfn.imaging.render import render_depth
from graspfn.learning.dataset import Samples
from graspfn.learning.height_inputs import HeightInputs, cells
from graspfn.learning.sensor import View, sense
from graspfn.learning.targets import GraspTargets
from graspfn.learning.training import _made_here
from graspfn.params import Noise

torch.set_num_threads(1)
CAMERA = Camera.of_the_paper(640, 480, 570.0)
VIEW = View.of(CAMERA)
CLEAN = Noise(0.0, 0.0)
ALL = Noise(1.0, 1.5, 20.0, 20.0, 75.0, 1.0, 0.3, 1.5, 0.02, 3.0, 0.3, 0.5, 0.002, 0.2)
MESHES = [trimesh.creation.box((0.12, 0.05, 0.04)), trimesh.creation.cone(0.04, 0.07)]
RESTING = [translation(0.0, 0.0, 0.02), translation(0.02, 0.01, 0.0)]


@pytest.fixture(scope="module")
def maps():
    return np.stack([render_heights(mesh, T) for mesh, T in zip(MESHES, RESTING, strict=True)])


@pytest.fixture(scope="module")
def table():
    rng = np.random.default_rng(0)
    n = 12
    return pd.DataFrame(
        {
            "row": np.arange(n) % 2,
            "shift_u_m": rng.uniform(-0.1, 0.1, n),
            "shift_v_m": rng.uniform(-0.06, 0.06, n),
            "theta_rad": rng.uniform(0, 2 * np.pi, n),
            "mirrored": np.arange(n) % 3 == 0,
            "empty": np.arange(n) == 7,
            "noise_seed": rng.integers(2**32, size=n, dtype=np.uint32),
        }
    )


def quarters(fine):
    """(1, 264, 352) -> (1, 4, 132, 176)."""
    return torch.stack([fine[:, i::2, j::2] for i in (0, 1) for j in (0, 1)], dim=1)


def rendered(line):
    """The map (132, 176) of the object moved first and rendered then; mirrored last."""
    T = T_world_scene(np.array([line["shift_u_m"], line["shift_v_m"]]), line["theta_rad"])
    fine = torch.from_numpy(render_heights(MESHES[line["row"]], T @ RESTING[line["row"]]))[None]
    moved = cells(quarters(fine))[0].numpy()
    return (moved[::-1] if line["mirrored"] else moved) * (not line["empty"])


def test_moving_the_map_is_moving_the_object(maps, table):
    moved = HeightInputs(maps, table, VIEW, CLEAN).moved(list(range(len(table)))).numpy()
    for ours, (_, line) in zip(moved, table.iterrows(), strict=True):
        expected = rendered(line)
        off = np.abs(ours - expected)
        assert (off > 0.002).sum() < 0.15 * max((expected > 0).sum(), 1)  # at the outline, a quarter of a cell wide
        assert np.median(off[expected > 0.01]) < 2e-4 if expected.any() else not ours.any()
        assert ours.sum() == pytest.approx(expected.sum(), rel=0.02)


def test_without_noise_what_is_seen_is_the_moved_map(maps, table):
    inputs = HeightInputs(maps, table, VIEW, CLEAN)
    heights, seen = inputs.batch(list(range(len(table)))).unbind(1)
    assert heights.shape == (len(table), 132, 176)
    assert set(seen.unique().tolist()) == {0.0, 1.0}
    moved = inputs.moved(list(range(len(table))))
    assert torch.equal(heights, torch.where(moved < TABLE_M, 0, moved) / 0.1 * seen)
    assert seen.mean() > 0.97


def test_a_sample_depends_on_its_line_alone(maps, table):
    """Whatever the batch, the table around it and where the maps are; half of the lines differ in their noise alone."""
    inputs = HeightInputs(maps, table, VIEW, ALL)
    together = inputs.batch([3, 1, 8, 5, 2])
    for place, index in enumerate([3, 1, 8, 5, 2]):
        assert torch.equal(inputs.batch([index])[0], together[place])
        alone = HeightInputs(maps, table.iloc[[index]].reset_index(drop=True), VIEW, ALL)
        assert torch.equal(alone.batch([0])[0], together[place])
    elsewhere = HeightInputs(maps, table, VIEW, ALL)
    elsewhere.to(torch.device("cpu"))
    assert torch.equal(elsewhere.batch([3, 1, 8, 5, 2]), together)
    other = HeightInputs(maps, table.assign(noise_seed=table["noise_seed"] + np.uint32(1)), VIEW, ALL)
    assert not torch.equal(other.batch([3]), inputs.batch([3]))


def test_blocks_on_a_device_are_the_same_batches(maps, table):
    successes = np.random.default_rng(0).integers(0, 6, (2, 33, 44, 6)).astype(np.uint8)
    samples = Samples(table, HeightInputs(maps, table, VIEW, ALL), GraspTargets(successes, 5, table))
    places = [[0, 3], [1, 1], [5, 2], [4, 8]]
    single = [samples.__getitems__(place) for place in places]
    assert samples.to(torch.device("cpu"))
    block = list(_made_here(samples, iter(places)))
    assert len(block) == len(single)
    for one, other in zip(single, block, strict=True):
        assert all(torch.equal(a, b) for a, b in zip(one, other, strict=True))


def test_jitter_of_pixels_shows_at_outlines_alone(maps, table):
    line = pd.concat([table.iloc[[4]]] * 60).reset_index(drop=True).assign(noise_seed=np.arange(60, dtype=np.uint32))
    moved = HeightInputs(maps, line, VIEW, dataclasses.replace(CLEAN, sigma_p_px=1.0)).moved(list(range(60))).numpy()
    still = HeightInputs(maps, line, VIEW, CLEAN).moved([0]).numpy()[0]
    spread = moved.std(axis=0)
    within = ndimage.minimum_filter(still, 9) > 0.0399
    assert within.any() and spread[:5].max() == 0 and spread[within].max() < 1e-6
    outline = np.hypot(*np.gradient(still)) > 0.01
    assert spread[outline].mean() > 0.002


def test_a_cell_is_its_top_as_a_height_map_sums_it_up():
    fine = torch.zeros(1, 264, 352)
    fine[0, :2, :2] = torch.tensor([[0.050, 0.048], [0.020, 0.0]])
    assert cells(quarters(fine))[0, 0, 0].item() == pytest.approx(0.049)
    assert cells(quarters(fine))[0, 1:].max() == 0


def test_digests_tell_noise_and_views_apart(maps, table):
    successes = np.zeros((2, 33, 44, 6), np.uint8)
    made = [
        Samples(table, HeightInputs(maps, table, view, noise), GraspTargets(successes, 5, table)).digest()
        for view, noise in ((VIEW, CLEAN), (VIEW, ALL), (dataclasses.replace(VIEW, height_m=0.5), CLEAN), (VIEW, CLEAN))
    ]
    assert len(set(made)) == 3
    assert made[0] == made[3]


def test_samples_are_what_the_camera_itself_gives(maps, table):
    """Rendered, with the same noise and put on the table as test images are: the same heights, holes and spread."""
    draws = 12
    lines = table[~table["mirrored"] & ~table["empty"]].iloc[:4]
    many = lines.loc[lines.index.repeat(draws)].reset_index(drop=True)
    many["noise_seed"] = np.arange(len(many), dtype=np.uint32)
    inputs = HeightInputs(maps, many, VIEW, Noise(1.0, 1.5))
    ours, seen = sense(inputs.moved(list(range(len(many)))), inputs.seeds, inputs.noise, VIEW)
    ours, seen = (part.numpy().reshape(4, draws, 132, 176) for part in (ours, seen))
    for (_, line), one, there in zip(lines.iterrows(), ours, seen, strict=True):
        T = T_world_scene(np.array([line["shift_u_m"], line["shift_v_m"]]), line["theta_rad"])
        depth = render_depth(MESHES[line["row"]], T @ RESTING[line["row"]], CAMERA)
        rngs = [np.random.default_rng(i) for i in range(draws)]
        maps_of = [height_map(add_noise(depth, Noise(1.0, 1.5), rng), CAMERA) for rng in rngs]
        real, known = np.stack([m.heights for m in maps_of]), np.stack([m.seen for m in maps_of])
        bare = one.max(axis=0) < 0.005
        bare &= there.all(axis=0) & known.all(axis=0)
        assert one.std(axis=0)[bare].mean() == pytest.approx(real.std(axis=0)[bare].mean(), rel=0.05)
        assert abs(one.mean(axis=0)[bare].mean() - real.mean(axis=0)[bare].mean()) < 1.5e-4
        assert (one > 0.008).sum() == pytest.approx((real > 0.008).sum(), rel=0.06)
        assert one[one > 0.008].mean() == pytest.approx(real[real > 0.008].mean(), rel=0.03)
        assert np.abs((~there).mean(axis=0) - (~known).mean(axis=0)).sum() < 120  # cells, round the object
