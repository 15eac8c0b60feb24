"""Pre-training: the same loop, on names of classes."""

import numpy as np
import pytest
import torch

from graspfn.imaging.camera import Camera
from graspfn.learning.augmentation import augmentation_table
from graspfn.learning.dataset import Samples
from graspfn.learning.depth_inputs import DepthInputs
from graspfn.learning.networks import build_network
from graspfn.learning.pretraining import class_indices, pretrain
from graspfn.learning.targets import ClassTargets
from graspfn.learning.training import Resources
from graspfn.params import AlexNet, Augment, Network, Noise, Pretrain

CAMERA = Camera.of_the_paper(640, 480, 570.0)
PARAMS = {"alexnet": AlexNet("alexnet", 8, 3e-3, 1e-2, 16, 0.0), "fcn": Network("fcn", 4, 1e-2, 1e-2)}


@pytest.fixture(scope="module")
def images():
    """Slabs of 2 cm and of 8 cm height."""
    images = np.full((4, 480, 640), CAMERA.table_depth, np.float32)
    images[:2, 200:280, 280:360] -= 0.02
    images[2:, 200:280, 280:360] -= 0.08
    return images


def run(params, images, classes, epochs, folder):
    maps = (CAMERA.table_depth - images)[:, 108:372, 144:496]  # heights do not matter to where it may go
    table = augmentation_table(maps, [str(i) for i in range(len(images))], Augment(8, True, 0.0), seed=0)
    indices, names = class_indices(classes)
    inputs = DepthInputs(images, table, CAMERA, Noise(1.0, 1.5))
    dataset = Samples(table, inputs, ClassTargets(indices, table))
    network = build_network(params)
    resources = Resources(torch.device("cpu"), folder, 1e9, progress=False)
    return network, *pretrain(network, dataset, names, Pretrain(epochs, 8), params, 0, resources)


def unchanged(network, params):
    fresh = build_network(params).state_dict()
    return all(torch.equal(value, fresh[name]) for name, value in network.state_dict().items())


def test_names_become_indices():
    indices, names = class_indices(["cup", "bowl", "cup", "chair"])
    assert names == ["bowl", "chair", "cup"]
    assert indices.tolist() == [2, 0, 2, 1]


@pytest.mark.parametrize("name", PARAMS)
def test_learns_to_tell_two_classes_apart(name, images, tmp_path):
    network, history, notes = run(PARAMS[name], images, ["low", "low", "high", "high"], 6.0, tmp_path)
    assert notes == {"pretrained_on": ["high", "low"]}
    assert history["loss"].iloc[-4:].mean() < 0.7 * np.log(2)  # that of a guess is log 2
    assert not unchanged(network, PARAMS[name])
    fresh = build_network(PARAMS[name]).state_dict()
    assert torch.equal(network.state_dict()["output.weight"], fresh["output.weight"])  # grasps were not shown


@pytest.mark.parametrize(("classes", "epochs", "why"), [(["cup"] * 4, 6.0, "one class"), (list("abcd"), 0.0, "epochs")])
def test_nothing_to_learn_leaves_the_weights_and_says_so(classes, epochs, why, images, tmp_path):
    network, history, notes = run(PARAMS["fcn"], images, classes, epochs, tmp_path)
    assert unchanged(network, PARAMS["fcn"])
    assert history.empty
    assert notes["pretrained_on"] == []
    assert why in notes["not_pretrained"]
