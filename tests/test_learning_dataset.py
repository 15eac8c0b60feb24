"""Training samples: the same motion and noise as the plain versions, a pure function of a line of the table."""

import numpy as np
import pandas as pd
import pytest
import torch
import trimesh

from graspfn.geometry.transforms import translation
from graspfn.imaging.camera import Camera
from graspfn.imaging.network_input import INPUT_SHAPE, depth_input
from graspfn.imaging.noise import add_noise
from graspfn.imaging.render import render_depth
from graspfn.imaging.warp import move_function, move_image
from graspfn.learning.augmentation import augmentation_table
from graspfn.learning.dataset import ClassSamples, GraspSamples
from graspfn.params import Noise

torch.set_num_threads(1)  # as in a loader; more would only wait for each other on samples this small
CAMERA = Camera.of_the_paper(640, 480, 570.0)
CLEAN, NOISY = Noise(0.0, 0.0), Noise(1.0, 1.5)
IDS = ["box", "ball"]


@pytest.fixture(scope="module")
def images():
    box, ball = trimesh.creation.box((0.15, 0.06, 0.05)), trimesh.creation.icosphere(4, 0.04)
    return np.stack(
        [render_depth(box, translation(0, 0, 0.025), CAMERA), render_depth(ball, translation(0, 0, 0.04), CAMERA)]
    )


@pytest.fixture(scope="module")
def successes():
    return np.random.default_rng(0).integers(0, 6, (2, 33, 44, 6)).astype(np.uint8)


@pytest.fixture(scope="module")
def table(images):
    return augmentation_table(images, IDS, CAMERA, 3, seed=1)


def motion(line):
    return line[["shift_u_m", "shift_v_m"]].to_numpy(dtype=float), float(line["theta_rad"])


def test_table_has_its_lines_in_order(table):
    assert table["row"].tolist() == [0, 0, 0, 1, 1, 1]
    assert table["noise_seed"].dtype == np.uint32
    assert table["noise_seed"].nunique() == 6
    assert table["theta_rad"].between(0, 2 * np.pi).all()


def test_draws_belong_to_the_id_whatever_the_order(images, table):
    other = augmentation_table(images[::-1], IDS[::-1], CAMERA, 3, seed=1)
    pd.testing.assert_frame_equal(
        other[other["row"] == 1].drop(columns="row").reset_index(drop=True),
        table[table["row"] == 0].drop(columns="row").reset_index(drop=True),
    )
    assert not augmentation_table(images, IDS, CAMERA, 3, seed=2)["theta_rad"].equals(table["theta_rad"])


def test_without_noise_the_image_is_the_plain_moved_image(images, successes, table):
    samples = GraspSamples(images, successes, 5, table, CAMERA, CLEAN)
    for index, line in table.iterrows():
        slow = depth_input(move_image(images[int(line["row"])], *motion(line), CAMERA, CAMERA.table_depth), CAMERA)
        fast = samples.image(index)
        assert fast.shape == (1, *INPUT_SHAPE)
        assert fast.dtype == torch.float32
        assert np.abs(fast[0].numpy() - slow).max() < 1e-4  # of 10 cm


def test_labels_are_the_plain_moved_labels_to_the_nearest_class(images, successes, table):
    samples = GraspSamples(images, successes, 5, table, CAMERA, CLEAN)
    for index, line in table.iterrows():
        slow = move_function(successes[int(line["row"])].astype(float), *motion(line))
        fast = samples.label(index).numpy()
        assert fast.shape == (33, 44, 6)
        assert np.abs(fast - slow).max() < 0.5 + 1e-4
        assert len(np.unique(fast)) == 6


def test_labels_of_other_counts_of_attempts_use_the_same_six_classes(images, successes, table):
    still = table.assign(shift_u_m=0.0, shift_v_m=0.0, theta_rad=0.0)
    samples = GraspSamples(images, successes * 2, 10, still, CAMERA, CLEAN)
    assert np.array_equal(samples.label(0).numpy(), successes[0])
    assert samples.class_frequencies() == pytest.approx(np.bincount(successes.ravel(), minlength=6) / successes.size)


def test_noise_has_the_statistics_of_eq_2(images):
    """Mean and spread over many noise seeds, next to those of move_image -> add_noise -> depth_input.

    The motion is by whole pixels: a second interpolation would blur the plain version's edges, hence its spread.
    """
    draws = 40
    line = pd.Series({"row": 0, "shift_u_m": -0.03, "shift_v_m": 0.02, "theta_rad": 0.0})
    many = pd.DataFrame([line] * draws).assign(noise_seed=np.arange(draws, dtype=np.uint32)).astype({"row": int})
    samples = ClassSamples(images, np.zeros(2), many, CAMERA, NOISY)
    fast = np.stack([samples.image(i)[0].numpy() for i in range(draws)])
    moved = move_image(images[int(line["row"])], *motion(line), CAMERA, CAMERA.table_depth)
    rng = np.random.default_rng(5)
    slow = np.stack([depth_input(add_noise(moved, NOISY, rng), CAMERA) for _ in range(draws)])
    table_std = 0.015 / 3.5**2 * np.sqrt((np.array([1, 1, 1, 0.5]) ** 2).sum() ** 2)
    assert slow[:, :5, :5].std() == pytest.approx(table_std, rel=0.05)
    assert fast.std(axis=0).mean() == pytest.approx(slow.std(axis=0).mean(), rel=0.01)
    standard_error = np.hypot(fast.std(axis=0), slow.std(axis=0)) / np.sqrt(draws)
    z = (fast.mean(axis=0) - slow.mean(axis=0)) / standard_error
    assert z.std() == pytest.approx(1, abs=0.05)
    clean = depth_input(moved, CAMERA)
    edge = np.hypot(*np.gradient(clean)) > 0.1
    assert 50 < edge.sum() < 500  # the outline, where jitter crosses depths
    assert fast.std(axis=0)[edge].mean() == pytest.approx(slow.std(axis=0)[edge].mean(), rel=0.03)


def test_a_sample_depends_on_its_line_alone(images, successes, table):
    whole = GraspSamples(images, successes, 5, table, CAMERA, NOISY)
    alone = GraspSamples(images, successes, 5, table.iloc[[4]], CAMERA, NOISY)
    assert all(torch.equal(one, other) for one, other in zip(whole[4], alone[0], strict=True))
    assert not torch.equal(whole[3][0], whole[4][0])
    assert torch.equal(whole[4][0], whole.image(4)) and torch.equal(whole[4][1], whole.label(4))


def test_a_class_belongs_to_the_object_of_its_line(images, table):
    samples = ClassSamples(images, np.array([7, 3]), table, CAMERA, CLEAN)
    assert len(samples) == len(table) == 6
    for i, row in enumerate(table["row"]):
        image, label = samples[i]
        assert torch.equal(image, samples.image(i)) and label == (7, 3)[row]


def test_an_image_that_q_does_not_fit_into_is_refused(images, table):
    with pytest.raises(ValueError, match="width_px"):
        ClassSamples(images[..., :600], np.zeros(2), table, Camera.of_the_paper(600, 480, 570.0), CLEAN)


def test_memory_maps_give_the_same_samples(images, successes, table, tmp_path):
    np.save(tmp_path / "images.npy", images)
    mapped = np.load(tmp_path / "images.npy", mmap_mode="r")
    one, other = (GraspSamples(source, successes, 5, table, CAMERA, NOISY)[2] for source in (images, mapped))
    assert torch.equal(one[0], other[0])


def test_digest_tells_runs_apart(images, successes, table):
    digests = {
        GraspSamples(images, successes, 5, table, CAMERA, NOISY).digest(),
        GraspSamples(images, successes[::-1], 5, table, CAMERA, NOISY).digest(),
        GraspSamples(images, successes, 5, table[:4], CAMERA, NOISY).digest(),
        GraspSamples(images, successes, 5, table, CAMERA, CLEAN).digest(),
    }
    assert len(digests) == 4
