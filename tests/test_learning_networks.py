"""Every architecture: shapes, what a cell sees, saving, predicting."""

import dataclasses
import json

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from graspfn.learning.folder import WeightsError, input_kind
from graspfn.learning.networks import Classifier, build_network, middle
from graspfn.learning.prediction import predict
from graspfn.learning.weights import load_network, load_pretrained, save_network, save_pretrained
from graspfn.params import AlexNet, Network

PARAMS = {
    "alexnet": AlexNet("alexnet", 4, 1e-3, 0.0, 16, 0.3),  # its output layer is kept in 8 bits
    "fcn": Network("fcn", 4, 1e-3, 0.0),
    "turned": Network("turned", 4, 1e-3, 0.0),
}

OUTPUT = ["output.weight", "output.bias"]


@pytest.fixture(params=PARAMS)
def params(request):
    return PARAMS[request.param]


@pytest.fixture
def inputs():
    return np.random.default_rng(0).random((3, 132, 176)).astype(np.float32)


def test_logits_for_every_pose_and_class(params, inputs):
    network = build_network(params)
    x = torch.from_numpy(inputs)[:, None]
    assert network(x).shape == (3, 33, 44, 6, 6)
    assert network.features(x).shape == (3, network.n_features)
    assert Classifier(network, 5)(x).shape == (3, 5)


def test_a_height_map_has_two_channels_and_both_are_used(params):
    network = build_network(dataclasses.replace(params, input="height_map"))
    x = torch.rand(2, 2, 132, 176, requires_grad=True)
    network(x).square().sum().backward()
    assert (x.grad.abs().sum(dim=(0, 2, 3)) > 0).all()
    assert predict(network, x.detach().numpy()).shape == (2, 33, 44, 6)


def test_weights_come_from_the_seed_alone(params):
    torch.manual_seed(1)
    one = build_network(params, seed=3).state_dict()
    torch.manual_seed(2)
    same, other = build_network(params, seed=3).state_dict(), build_network(params, seed=4).state_dict()
    assert all(torch.equal(one[name], same[name]) for name in one)
    assert not all(torch.equal(one[name], other[name]) for name in one)


def test_every_weight_is_trained(params, inputs):
    network = build_network(params)
    network(torch.from_numpy(inputs)[:, None]).square().sum().backward()
    assert all(weight.grad is not None and weight.grad.abs().sum() > 0 for weight in network.parameters())


def test_classification_trains_all_that_the_grasp_function_shares(params, inputs):
    network = build_network(params)
    Classifier(network, 2)(torch.from_numpy(inputs)[:, None]).square().sum().backward()
    untrained = [name for name, weight in network.named_parameters() if weight.grad is None]
    own = ["one.output.weight", "one.output.bias", "beyond"] if params.architecture == "turned" else OUTPUT
    assert sorted(untrained) == sorted(own)


def test_prior_is_what_an_empty_network_predicts(params):
    network = build_network(params)
    frequencies = np.array([0.9, 0.04, 0.03, 0.01, 0.01, 0.01])
    network.set_prior(frequencies)
    with torch.no_grad():
        getattr(network, "one", network).output.weight.zero_()
        probability = network.eval()(torch.zeros(1, 1, 132, 176)).softmax(dim=-1)
    assert np.allclose(probability, frequencies, atol=1e-6)


def test_a_cell_of_the_fcn_sees_at_least_9_cm_each_way(inputs):
    """The furthest input pixels that change the logits of the middle cell: 36 pixels of 2.5 mm are 9 cm."""
    network = build_network(Network("fcn", 8, 1e-3, 0.0)).eval()
    x = torch.from_numpy(inputs[:1])[:, None].requires_grad_()
    network(x)[0, 16, 22].sum().backward()
    rows, columns = np.nonzero(x.grad[0, 0].numpy())
    assert rows.min() <= 66 - 36
    assert rows.max() >= 66 + 36
    assert columns.min() <= 90 - 36
    assert columns.max() >= 90 + 36


def test_fcn_moves_with_its_input():
    """It halves its grid twice below the cells', so that a shift by four cells is exact away from the border."""
    network = build_network(Network("fcn", 8, 1e-3, 0.0)).eval()
    x = np.zeros((132, 176), np.float32)
    x[56:72, 70:90] = np.random.default_rng(0).random((16, 20))
    scores = predict(network, np.stack([x, np.roll(x, (16, -16), axis=(0, 1))]))
    here, there = scores[0, 12:20, 17:23], scores[1, 16:24, 13:19]
    assert np.ptp(here) > 1e-3
    assert np.allclose(here, there, atol=0.02 * np.ptp(here))


def test_scores_are_expectations(params, inputs):
    network = build_network(params)
    scores = predict(network, inputs)
    assert scores.shape == (3, 33, 44, 6)
    assert scores.dtype == np.float32
    with torch.no_grad():
        logits = network(torch.from_numpy(inputs)[:, None]).double().numpy()
    probability = np.exp(logits) / np.exp(logits).sum(axis=-1, keepdims=True)
    assert np.allclose(scores, (probability * [0, 0.2, 0.4, 0.6, 0.8, 1]).sum(axis=-1), atol=1e-5)


def test_scores_do_not_depend_on_the_batch(params, inputs):
    many = np.concatenate([inputs] * 7)
    network = build_network(params)
    assert np.allclose(predict(network, many)[-3:], predict(network, inputs), atol=1e-5)
    assert predict(network, inputs[:0]).shape == (0, 33, 44, 6)


def test_the_number_of_cores_changes_no_bit_of_a_score(params, inputs, monkeypatch):
    network, many = build_network(params), np.concatenate([inputs] * 12)
    found = []
    for count in (1, 3):
        monkeypatch.setattr("graspfn.learning.prediction.cores", lambda count=count: count)
        found.append(predict(network, many).tobytes())
    assert found[0] == found[1]


def test_saved_networks_come_back(params, inputs, tmp_path):
    network = build_network(params, seed=5)
    save_network(tmp_path / "net", network, params, pretrained_on=["cup", "bowl"])
    assert sorted(path.name for path in (tmp_path / "net").iterdir()) == ["config.json", "weights.safetensors"]
    assert json.loads((tmp_path / "net/config.json").read_text())["pretrained_on"] == ["cup", "bowl"]
    assert np.allclose(predict(load_network(tmp_path / "net"), inputs), predict(network, inputs), atol=1e-3)


def test_saving_what_came_back_changes_nothing(params, tmp_path):
    save_network(tmp_path / "one", build_network(params, seed=5), params)
    save_network(tmp_path / "two", load_network(tmp_path / "one"), params)
    assert (tmp_path / "one/weights.safetensors").read_bytes() == (tmp_path / "two/weights.safetensors").read_bytes()


def test_a_huge_layer_is_kept_in_8_bits_within_half_a_step_of_each_row(tmp_path):
    network = build_network(PARAMS["alexnet"], seed=5)
    scales = torch.logspace(-6, 2, len(network.output.weight))
    with torch.no_grad():
        network.output.weight *= scales[:, None]
        network.output.weight[7] = 0
    save_network(tmp_path, network, PARAMS["alexnet"])
    weight = network.output.weight.detach()
    error = (load_network(tmp_path).output.weight.detach() - weight).abs().amax(dim=1)
    assert (error <= 0.51 * weight.abs().amax(dim=1) / 127).all()
    assert (tmp_path / "weights.safetensors").stat().st_size < 1.5 * weight.numel()  # all else is small


def test_pretraining_hands_on_all_but_the_output_layer(params, tmp_path):
    save_pretrained(tmp_path, build_network(params, seed=5), params)
    network, same, other = load_pretrained(tmp_path, 6), build_network(params, seed=5), build_network(params, seed=6)
    for name, tensor in network.state_dict().items():
        expected = (other if "output" in name else same).state_dict()[name]
        assert torch.allclose(tensor, expected, atol=1e-3), name
    with pytest.raises(WeightsError, match="output"):
        load_network(tmp_path)


def test_a_network_that_says_of_no_input_sees_depth_images(params, tmp_path):
    save_network(tmp_path, build_network(params), params)
    config = json.loads((tmp_path / "config.json").read_text())
    del config["network"]["input"]
    (tmp_path / "config.json").write_text(json.dumps(config))
    assert input_kind(tmp_path) == "depth"
    load_network(tmp_path)


@pytest.mark.parametrize("text", [b'{"network": []}', b'{"network": null}', b'{"network": {}}'])
def test_what_no_network_sees_is_one_line(tmp_path, text):
    (tmp_path / "config.json").write_bytes(text)
    with pytest.raises(ValueError, match=str(tmp_path)):
        input_kind(tmp_path)


def test_a_pointer_of_git_lfs_is_told_as_one(params, tmp_path):
    save_network(tmp_path, build_network(params), params)
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1465672\n"
    (tmp_path / "weights.safetensors").write_text(pointer)
    with pytest.raises(WeightsError, match=r"weights.safetensors: a pointer of Git LFS.*`git lfs pull`"):
        load_network(tmp_path)


def spoil_config(folder):
    (folder / "config.json").write_text("{")


def config_of(text):
    def spoil(folder):
        (folder / "config.json").write_bytes(text)

    return spoil


def spoil_key(**values):
    def spoil(folder):
        config = json.loads((folder / "config.json").read_text())
        config["network"].update(values)
        (folder / "config.json").write_text(json.dumps(config))

    return spoil


NO_CONFIG = [b"", b"[]", b"null", b"3", b'"fcn"', b"{}", b'{"network": []}', b'{"network": null}', b'{"network": {}}']
NO_CONFIG += [b"\xff\xfe", b"[" * 100_000, b'{"network": 1']
NO_NETWORK = [{"architecture": []}, {"width": "wide"}, {"width": 0}, {"width": True}, {"width": 10**30}, {"colour": 1}]


def config_is_a_folder(folder):
    (folder / "config.json").unlink()
    (folder / "config.json").mkdir()


def weights_are_a_folder(folder):
    (folder / "weights.safetensors").unlink()
    (folder / "weights.safetensors").mkdir()


def cut_weights(length):
    def spoil(folder):
        path = folder / "weights.safetensors"
        path.write_bytes(path.read_bytes()[:length])

    return spoil


def edit_weights(edit):
    def spoil(folder):
        state = load_file(folder / "weights.safetensors")
        save_file(edit(state), folder / "weights.safetensors")

    return spoil


def without_output(state):
    return {name: tensor for name, tensor in state.items() if "output" not in name}


def with_another(state):
    return state | {"another": torch.zeros(1)}


def with_nan(state):
    return state | {name: tensor * float("nan") for name, tensor in state.items() if name.endswith("output.bias")}


def spoil_architecture(folder):
    config = json.loads((folder / "config.json").read_text())
    config["network"]["architecture"] = "resnet"
    (folder / "config.json").write_text(json.dumps(config))


def spoil_width(folder):
    config = json.loads((folder / "config.json").read_text())
    config["network"]["width"] += 1
    (folder / "config.json").write_text(json.dumps(config))


def spoil_weights(folder):
    (folder / "weights.safetensors").write_bytes(b"not safetensors")


def remove_weights(folder):
    (folder / "weights.safetensors").unlink()


def remove_config(folder):
    (folder / "config.json").unlink()


@pytest.mark.parametrize(
    "spoil",
    [
        *(spoil_config, spoil_architecture, spoil_width, spoil_weights, remove_weights, remove_config),
        *(config_is_a_folder, weights_are_a_folder, *map(config_of, NO_CONFIG)),
        *(spoil_key(**values) for values in NO_NETWORK),
        *map(cut_weights, (0, 5, 100, -10)),
        *map(edit_weights, (without_output, with_another, with_nan)),
    ],
)
def test_a_folder_without_a_network_is_one_line(params, tmp_path, spoil):
    save_network(tmp_path, build_network(params), params)
    spoil(tmp_path)
    with pytest.raises(ValueError, match=str(tmp_path)) as caught:
        load_network(tmp_path)
    assert "\n" not in str(caught.value)


def test_a_quarter_turn_of_the_object_turns_its_grasp_function():
    """About a point for which the poses of Q and the pixels of the input come to lie on each other; to rounding."""
    network = build_network(dataclasses.replace(PARAMS["turned"], input="height_map"))
    torch.nn.init.normal_(network.one.output.weight, std=0.5, generator=torch.Generator().manual_seed(0))
    network.eval()
    rng = np.random.default_rng(0)
    heights = np.zeros((132, 176), np.float32)
    heights[54:80, 78:118] = rng.uniform(0.2, 0.9, (26, 40))
    heights[60:64, 84:92] = 0.0
    v, u = np.indices(heights.shape) - np.array([131, 175])[:, None, None] / 2
    turned = np.zeros_like(heights)  # (u, v) comes to (2 - v, u - 2)
    inside = heights > 0
    turned[(u[inside] - 2 + 65.5).astype(int), (2 - v[inside] + 87.5).astype(int)] = heights[inside]
    x = torch.from_numpy(np.stack([np.stack([h, np.ones_like(h)]) for h in (heights, turned)]))
    x[:, 1] = x[:, 0] > 0  # what is seen turns as well
    with torch.no_grad():
        before, after = network(x).numpy()
    rows, columns = np.indices((33, 44))
    v, u = rows - 16, columns - 21.5  # in cells
    to_row, to_column = (u - 0.5 + 16).astype(int), (0.5 - v + 21.5).astype(int)
    there = (to_row >= 0) & (to_row < 33) & (to_column >= 0) & (to_column < 44)
    assert there.sum() > 1000
    moved = after[to_row[there], to_column[there]]
    # Further angles come round to the first three, half a turn on, and that is for the network to learn.
    np.testing.assert_allclose(moved[:, 3:], before[there][:, :3], atol=1e-4)
    assert np.ptp(before) > 0.2


def test_the_middle_of_an_object_is_between_its_ends():
    x = torch.zeros(3, 2, 132, 176)
    x[0, 0, 10:30, 100:160] = 0.5
    x[0, 0, 100, 5] = 0.5  # a speck does not count
    x[1, 0, 66:132, :88] = 0.3
    found = middle(x)
    np.testing.assert_allclose(found, [[130 - 88, 20 - 66], [-44, 33], [0, 0]], atol=1.01)
    assert (found[2] == 0).all()
    flipped = middle(x.flip(2).flip(3))
    np.testing.assert_allclose(flipped, -found, atol=1e-5)
