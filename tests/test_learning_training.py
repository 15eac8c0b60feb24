"""The training loop: resumes to the bit, refuses nonsense, and learns."""

import errno
import os

import numpy as np
import pandas as pd
import pytest
import torch
import trimesh
from scipy import ndimage

from graspfn.geometry.transforms import translation
from graspfn.imaging.camera import Camera
from graspfn.imaging.orthographic import render_heights
from graspfn.learning.augmentation import augmentation_table
from graspfn.learning.checkpoint import FILE
from graspfn.learning.dataset import Samples
from graspfn.learning.device import pick_device
from graspfn.learning.height_inputs import HeightInputs
from graspfn.learning.networks import build_network
from graspfn.learning.prediction import predict
from graspfn.learning.sensor import View
from graspfn.learning.targets import GraspTargets, split_classes
from graspfn.learning.training import Descent, Resources, TrainingError, batches, fit, grasp_loss, train
from graspfn.params import AlexNet, Augment, Network, Noise, Train

CAMERA = Camera.of_the_paper(640, 480, 570.0)
ALEXNET = AlexNet("alexnet", 2, 1e-3, 1e-2, 4, 0.3)
FCN = Network("fcn", 4, 1e-2, 1e-2)
SEES_HEIGHTS = Network("fcn", 4, 1e-2, 1e-2, input="height_map")
BOXES = [trimesh.creation.box(size) for size in ((0.14, 0.03, 0.03), (0.10, 0.04, 0.05))]
DESCENT = Descent("train", 0, 1.5, 4, 1e-2, 1e-2)


class Interrupted(Exception):
    """Stands for a killed process."""


class Tiny:
    """16 samples of noise; raises at the `stop`-th one that is asked for."""

    def __init__(self, stop=None):
        self.stop, self.asked = stop, 0

    def __len__(self):
        return 16

    def __getitems__(self, indices):
        self.asked += len(indices)
        if self.stop is not None and self.asked >= self.stop:
            raise Interrupted
        rngs = [np.random.default_rng(index) for index in indices]
        images = np.stack([rng.random((1, 132, 176), dtype=np.float32) for rng in rngs])
        return tuple(
            map(torch.from_numpy, (images, np.stack([rng.random((33, 44, 6), np.float32) * 5 for rng in rngs])))
        )

    def digest(self):
        return "tiny"


def resources(folder, every_s=1e9, **options):
    return Resources(torch.device("cpu"), folder, every_s, progress=False, **options)


@pytest.mark.parametrize("params", [ALEXNET, FCN], ids=["alexnet", "fcn"])
def test_interrupted_and_resumed_is_the_same_to_the_bit(params, tmp_path):
    whole, parts = build_network(params), build_network(params)
    history = fit(whole, grasp_loss, Tiny(), DESCENT, resources(tmp_path / "whole"))
    with pytest.raises(Interrupted):  # in the fourth of six steps, with a checkpoint after every one
        fit(parts, grasp_loss, Tiny(stop=15), DESCENT, resources(tmp_path / "parts", 0))
    assert [path.name for path in (tmp_path / "parts").iterdir()] == [FILE]
    parts, rest = build_network(params), Tiny()
    resumed = fit(parts, grasp_loss, rest, DESCENT, resources(tmp_path / "parts"))
    assert rest.asked == 3 * 4  # it did not start over
    pd.testing.assert_frame_equal(history, resumed, check_exact=True)
    assert all(torch.equal(value, parts.state_dict()[name]) for name, value in whole.state_dict().items())
    assert list((tmp_path / "parts").iterdir()) == []


def test_a_checkpoint_of_another_run_is_left_alone(tmp_path):
    with pytest.raises(Interrupted):
        fit(build_network(ALEXNET), grasp_loss, Tiny(stop=15), DESCENT, resources(tmp_path, 0))
    other = Tiny()
    fit(build_network(ALEXNET, seed=1), grasp_loss, other, DESCENT, resources(tmp_path))
    assert other.asked == 6 * 4


def test_processes_that_load_do_not_change_the_result(tmp_path):
    alone, helped = (
        fit(build_network(ALEXNET), grasp_loss, Tiny(), DESCENT, resources(tmp_path, loaders=count)) for count in (0, 2)
    )
    pd.testing.assert_frame_equal(alone, helped, check_exact=True)


def no_room(*arguments):
    raise RuntimeError("unable to allocate shared memory(shm): No space left on device (28)")


def test_loaders_take_no_shared_memory(tmp_path, monkeypatch):
    """A container has 64 MB in /dev/shm or less."""
    monkeypatch.setattr(torch.UntypedStorage, "_new_shared", no_room)
    monkeypatch.setattr(torch.UntypedStorage, "_share_fd_cpu_", no_room)
    history = fit(build_network(ALEXNET), grasp_loss, Tiny(), DESCENT, resources(tmp_path, loaders=1))
    assert len(history) == 6


def test_where_no_loader_starts_the_trainer_makes_its_samples(tmp_path, monkeypatch, capsys):
    def full():
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    alone = fit(build_network(ALEXNET), grasp_loss, Tiny(), DESCENT, resources(tmp_path))
    monkeypatch.setattr(torch.multiprocessing, "Queue", full)
    fallen = fit(build_network(ALEXNET), grasp_loss, Tiny(), DESCENT, resources(tmp_path, loaders=2))
    assert capsys.readouterr().out.startswith("compute.loaders: none could be started (No space left on device); ")
    pd.testing.assert_frame_equal(alone, fallen, check_exact=True)


def test_threads_are_given_back(tmp_path):
    before = torch.get_num_threads()
    fit(build_network(ALEXNET), grasp_loss, Tiny(), DESCENT, resources(tmp_path, threads=before + 1))
    assert torch.get_num_threads() == before


def test_every_epoch_shows_every_sample_once_in_its_own_order():
    descent = Descent("train", 0, 3.0, 4, 1e-2, 0.0)
    flat = np.concatenate(list(batches(10, descent, 0, 15)))
    orders = flat[:30].reshape(3, 10)
    assert (np.sort(orders, axis=1) == np.arange(10)).all()
    assert len(np.unique(orders, axis=0)) == 3
    assert np.array_equal(flat[20:], np.concatenate(list(batches(10, descent, 5, 15))))


@pytest.mark.parametrize(("epochs", "steps"), [(0.25, 1), (0.5, 2), (1.5, 6), (0.001, 1)])
def test_epochs_may_be_fractions(epochs, steps):
    assert Descent("train", 0, epochs, 4, 1e-2, 0.0).steps(16) == steps


@pytest.mark.parametrize("steps", [1, 2, 10, 1000])
def test_learning_rate_rises_to_its_peak_and_falls_towards_zero(steps):
    rates = np.array([DESCENT.rate(step, steps) for step in range(steps)])
    peak = rates.argmax()
    assert rates.max() == pytest.approx(DESCENT.learning_rate)
    assert peak <= 0.1 * steps
    assert (np.diff(rates[: peak + 1]) > 0).all()
    assert (np.diff(rates[peak:]) < 0).all()
    assert rates.min() > 0


def test_loss_of_an_even_guess_is_the_entropy_of_six_classes():
    scores = torch.rand(2, 33, 44, 6) * 5
    assert grasp_loss(torch.zeros(2, 33, 44, 6, 6), scores).item() == pytest.approx(np.log(6))
    certain = torch.randint(0, 6, (2, 33, 44, 6))
    right = torch.nn.functional.one_hot(certain, 6) * 50.0
    assert grasp_loss(right, certain.float()).item() < 1e-6


def test_loss_is_least_where_the_expected_score_is_the_score():
    """Cross-entropy is least at the target's own shares, whose expectation is the unrounded score."""
    scores = torch.rand(1, 33, 44, 6) * 5
    best = split_classes(scores).clamp(min=1e-12).log()
    least = grasp_loss(best, scores)
    assert torch.allclose(best.softmax(dim=-1) @ torch.arange(6.0), scores, atol=1e-4)
    rng = np.random.default_rng(0)
    for _ in range(5):
        other = best + torch.from_numpy(rng.normal(0, 0.3, best.shape)).float()
        assert grasp_loss(other, scores) > least
    whole = torch.nn.functional.cross_entropy(best.reshape(-1, 6), split_classes(scores).reshape(-1, 6))
    assert least.item() == pytest.approx(whole.item(), rel=1e-5)


def test_a_loss_that_is_not_a_number_is_one_line(tmp_path):
    def broken(logits, scores):
        return grasp_loss(logits, scores) * float("nan")

    with pytest.raises(TrainingError, match=r"^network.learning_rate: at 0.01 the loss became nan in step 1 of 6; .*$"):
        fit(build_network(ALEXNET), broken, Tiny(), DESCENT, resources(tmp_path))


def test_unavailable_devices_are_one_line():
    assert pick_device("cpu") == torch.device("cpu")
    assert str(pick_device("auto")) in ("cpu", "cuda", "mps")
    missing = "mps" if not torch.backends.mps.is_available() else "cuda"
    with pytest.raises(ValueError, match=rf"^compute.device: {missing} is not available; .*$"):
        pick_device(missing)


@pytest.fixture(scope="module")
def objects():
    """Two boxes, and the grasps that a jaw round their middles would make: a toy of the physics."""
    maps = np.stack([render_heights(box, translation(0, 0, box.extents[2] / 2)) for box in BOXES])
    successes = np.zeros((2, 33, 44, 6), np.uint8)
    successes[:, 14:19, 18:26, 3] = 5  # across the long side
    return maps, successes


def test_learns_and_the_prediction_moves_with_the_object(objects, tmp_path):
    """After a hundred steps on two boxes, the best pose of a box in a new place lies across its middle."""
    maps, successes = objects
    table = augmentation_table(maps, ["a", "b"], Augment(16, True, 0.05), seed=0)
    inputs = HeightInputs(maps, table, View.of(CAMERA), Noise(1.0, 1.5))
    dataset = Samples(table, inputs, GraspTargets(successes, 5, table))
    network = build_network(SEES_HEIGHTS)
    history = train(network, dataset, Train(25.0, 8), SEES_HEIGHTS, 0, resources(tmp_path))
    assert history["loss"][-10:].mean() < 0.5 * history["loss"][:10].mean()
    unseen = augmentation_table(maps, ["c", "d"], Augment(4, True, 0.0), seed=1)
    clean = HeightInputs(maps, unseen, View.of(CAMERA), Noise(0.0, 0.0)).batch(list(range(8)))
    labels = GraspTargets(successes, 5, unseen).batch(list(range(8)))
    hits = 0
    for score, label in zip(predict(network, clean.numpy()), labels.numpy(), strict=True):
        good = ndimage.maximum_filter(label >= 2, (3, 3, 3), mode=("constant", "constant", "wrap"))
        hits += good[np.unravel_index(score.argmax(), score.shape)]
    assert hits >= 7
