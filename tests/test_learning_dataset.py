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
from graspfn.imaging.orthographic import render_heights
from graspfn.imaging.render import render_depth
from graspfn.imaging.warp import move_function, move_image
from graspfn.learning.augmentation import augmentation_table
from graspfn.learning.dataset import Samples
from graspfn.learning.depth_inputs import DepthInputs
from graspfn.learning.targets import ClassTargets, GraspTargets, split_classes
from graspfn.params import Augment, Noise

torch.set_num_threads(1)  # as in a loader; more would only wait for each other on samples this small
CAMERA = Camera.of_the_paper(640, 480, 570.0)
CLEAN, NOISY = Noise(0.0, 0.0), Noise(1.0, 1.5)
IDS = ["box", "ball"]


OBJECTS = [
    (trimesh.creation.box((0.15, 0.06, 0.05)), translation(0, 0, 0.025)),
    (trimesh.creation.icosphere(4, 0.04), translation(0, 0, 0.04)),
]


@pytest.fixture(scope="module")
def images():
    return np.stack([render_depth(mesh, T, CAMERA) for mesh, T in OBJECTS])


@pytest.fixture(scope="module")
def maps():
    return np.stack([render_heights(mesh, T) for mesh, T in OBJECTS])


@pytest.fixture(scope="module")
def successes():
    return np.random.default_rng(0).integers(0, 6, (2, 33, 44, 6)).astype(np.uint8)


@pytest.fixture(scope="module")
def table(maps):
    return augmentation_table(maps, IDS, Augment(3, False, 0.0), seed=1)


def grasps(images, successes, attempts, table, noise):
    return Samples(table, DepthInputs(images, table, CAMERA, noise), GraspTargets(successes, attempts, table))


def motion(line):
    return line[["shift_u_m", "shift_v_m"]].to_numpy(dtype=float), float(line["theta_rad"])


def test_table_has_its_lines_in_order(table):
    assert table["row"].tolist() == [0, 0, 0, 1, 1, 1]
    assert table["noise_seed"].dtype == np.uint32
    assert table["noise_seed"].nunique() == 6
    assert table["theta_rad"].between(0, 2 * np.pi).all()
    assert not table["mirrored"].any() and not table["empty"].any()


def test_draws_belong_to_the_id_whatever_the_order(maps, table):
    other = augmentation_table(maps[::-1], IDS[::-1], Augment(3, False, 0.0), seed=1)
    pd.testing.assert_frame_equal(
        other[other["row"] == 1].drop(columns="row").reset_index(drop=True),
        table[table["row"] == 0].drop(columns="row").reset_index(drop=True),
    )
    assert not augmentation_table(maps, IDS, Augment(3, False, 0.0), seed=2)["theta_rad"].equals(table["theta_rad"])


def test_without_noise_the_image_is_the_plain_moved_image(images, successes, table):
    samples = grasps(images, successes, 5, table, CLEAN)
    for index, line in table.iterrows():
        slow = depth_input(move_image(images[int(line["row"])], *motion(line), CAMERA, CAMERA.table_depth), CAMERA)
        fast = samples.inputs.image(index)
        assert fast.shape == (1, *INPUT_SHAPE)
        assert fast.dtype == torch.float32
        assert np.abs(fast[0].numpy() - slow).max() < 1e-4  # of 10 cm


def test_labels_are_the_plain_moved_labels(images, successes, table):
    samples = grasps(images, successes, 5, table, CLEAN)
    for index, line in table.iterrows():
        slow = move_function(successes[int(line["row"])].astype(float), *motion(line))
        fast = samples[index][1].numpy()
        assert fast.shape == (33, 44, 6)
        assert fast.dtype == np.float32
        assert np.abs(fast - slow).max() < 1e-4


def test_a_score_is_split_so_that_its_expectation_is_the_score():
    scores = torch.linspace(0, 5, 101)
    shares = split_classes(scores)
    assert shares.shape == (101, 6)
    assert shares.min() >= 0
    assert (shares > 0).sum(dim=-1).max() == 2  # the two it lies between
    assert torch.allclose(shares.sum(dim=-1), torch.ones(101), atol=1e-6)
    assert torch.allclose(shares @ torch.arange(6.0), scores, atol=1e-5)
    assert torch.equal(split_classes(torch.arange(6.0)), torch.eye(6))


def test_labels_of_other_counts_of_attempts_use_the_same_six_classes(images, successes, table):
    still = table.assign(shift_u_m=0.0, shift_v_m=0.0, theta_rad=0.0)
    samples = grasps(images, successes * 2, 10, still, CLEAN)
    assert samples[0][1].numpy() == pytest.approx(successes[0], abs=1e-5)
    frequencies = np.bincount(successes.ravel(), minlength=6) / successes.size
    assert samples.targets.class_frequencies() == pytest.approx(frequencies)
    odd = GraspTargets(successes, 7, still).class_frequencies()  # between classes
    assert odd.sum() == pytest.approx(1)
    assert odd @ np.arange(6) == pytest.approx(successes.mean() * 5 / 7)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.03, -0.02)])
def test_a_mirror_turns_v_and_theta_round(images, successes, table, shift):
    """Image and label of an object and of its mirror image, seen in the mirror, are the same."""
    line = table.iloc[[0]].assign(shift_u_m=shift[0], shift_v_m=shift[1], theta_rad=0.4)
    plain = grasps(images, successes, 5, line, CLEAN)[0]
    mirrored = grasps(images, successes, 5, line.assign(mirrored=True), CLEAN)[0]
    assert np.allclose(mirrored[0], plain[0].flip(1), atol=1e-5)
    assert torch.equal(mirrored[1], plain[1].flip(0)[:, :, [0, 5, 4, 3, 2, 1]])
    # The same as mirroring the object first and moving it by the mirrored motion.
    other = line.assign(shift_v_m=-shift[1], theta_rad=-0.4)
    turned = grasps(images[:, ::-1], successes[:, ::-1][..., [0, 5, 4, 3, 2, 1]], 5, other, CLEAN)[0]
    assert np.allclose(mirrored[0], turned[0], atol=1e-4)
    assert np.allclose(mirrored[1], turned[1], atol=1e-4)


def test_nothing_lies_on_an_empty_table(images, successes, table):
    image, label = grasps(images, successes, 5, table.assign(empty=True), CLEAN)[0]
    assert not image.any() and not label.any()


def test_shares_of_mirrored_and_empty_samples(maps):
    table = augmentation_table(maps, IDS, Augment(500, True, 0.1), seed=1)
    assert table["mirrored"].mean() == pytest.approx(0.5, abs=0.05)
    assert table["empty"].mean() == pytest.approx(0.1, abs=0.03)
    few = augmentation_table(maps, IDS, Augment(500, False, 0.0), seed=1)
    pd.testing.assert_frame_equal(few, table.assign(mirrored=False, empty=False))


def test_noise_has_the_statistics_of_eq_2(images):
    """Mean and spread over many noise seeds, next to those of move_image -> add_noise -> depth_input.

    The motion is by whole pixels: a second interpolation would blur the plain version's edges, hence its spread.
    """
    draws = 40
    line = {"row": 0, "shift_u_m": -0.03, "shift_v_m": 0.02, "theta_rad": 0.0, "mirrored": False, "empty": False}
    many = pd.DataFrame([line] * draws).assign(noise_seed=np.arange(draws, dtype=np.uint32))
    samples = DepthInputs(images, many, CAMERA, NOISY)
    fast = np.stack([samples.image(i)[0].numpy() for i in range(draws)])
    moved = move_image(images[int(line["row"])], *motion(pd.Series(line)), CAMERA, CAMERA.table_depth)
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
    whole = grasps(images, successes, 5, table, NOISY)
    alone = grasps(images, successes, 5, table.iloc[[4]], NOISY)
    assert all(torch.equal(one, other) for one, other in zip(whole[4], alone[0], strict=True))
    assert not torch.equal(whole[3][0], whole[4][0])
    together = whole.__getitems__([1, 4])
    assert torch.equal(whole[4][0], together[0][1]) and torch.equal(whole[4][1], together[1][1])


def test_a_class_belongs_to_the_object_of_its_line(images, table):
    samples = Samples(table, DepthInputs(images, table, CAMERA, CLEAN), ClassTargets(np.array([7, 3]), table))
    assert len(samples) == len(table) == 6
    for i, row in enumerate(table["row"]):
        image, label = samples[i]
        assert torch.equal(image, samples.inputs.image(i)) and label == (7, 3)[row]


def test_an_image_that_q_does_not_fit_into_is_refused(images, table):
    with pytest.raises(ValueError, match="width_px"):
        DepthInputs(images[..., :600], table, Camera.of_the_paper(600, 480, 570.0), CLEAN)


def test_memory_maps_give_the_same_samples(images, successes, table, tmp_path):
    np.save(tmp_path / "images.npy", images)
    mapped = np.load(tmp_path / "images.npy", mmap_mode="r")
    one, other = (grasps(source, successes, 5, table, NOISY)[2] for source in (images, mapped))
    assert torch.equal(one[0], other[0])


def test_digest_tells_runs_apart(images, successes, table):
    digests = {
        grasps(images, successes, 5, table, NOISY).digest(),
        grasps(images, successes[::-1], 5, table, NOISY).digest(),
        grasps(images, successes, 5, table[:4], NOISY).digest(),
        grasps(images, successes, 5, table, CLEAN).digest(),
        grasps(images, successes, 5, table.assign(mirrored=True), NOISY).digest(),
    }
    assert len(digests) == 5
