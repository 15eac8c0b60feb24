"""Networks as ONNX: what torch says, with any number of threads; a folder that does not fit is one line."""

from __future__ import annotations

import hashlib
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import torch
from made_models import save_model
from physics_params import PARAMS
from test_planning_planner import CAMERA, placed, seen

from graspfn.imaging.sight import look
from graspfn.learning.networks import build_network
from graspfn.learning.onnx_file import write_onnx
from graspfn.learning.prediction import OneByOne
from graspfn.learning.weights import load_network
from graspfn.planning.model import DEFAULT, NETWORK
from graspfn.planning.planner import GraspPlanner


@pytest.fixture(params=sorted(PARAMS.network))
def params(request):
    return PARAMS.network[request.param]


@pytest.fixture(scope="module")
def views() -> list[np.ndarray]:
    return [seen(CAMERA, placed((0.03 * k, -0.02), 0.6 * k)[0]) for k in range(3)]


def test_onnx_is_what_torch_says_with_any_number_of_threads(params, views, tmp_path):
    network = build_network(params).eval()
    torch.nn.init.normal_(network.output.weight, std=0.05, generator=torch.Generator().manual_seed(0))
    save_model(tmp_path, network, params)
    of_torch = OneByOne(network)
    of_onnx = [GraspPlanner.load(tmp_path, threads=threads).predict for threads in (1, 1, 2, 5)]
    for view in views:
        inputs = look(view, CAMERA, params.input, PARAMS.table).inputs
        expected, expected_likeliest = of_torch(inputs)
        found = [predict(inputs) for predict in of_onnx]
        for scores, likeliest in found:
            assert scores.dtype == np.float32 and likeliest.dtype == np.uint8
            np.testing.assert_allclose(scores, expected, atol=1e-4)
            np.testing.assert_allclose(scores, found[0][0], atol=1e-6)
            assert (likeliest == expected_likeliest).mean() > 0.999  # of equals either
        np.testing.assert_array_equal(found[0][0], found[1][0])
        assert np.ptp(expected) > 0.01


def test_threads_that_call_a_network_at_once_get_what_one_gets(views):
    predict = GraspPlanner.load(threads=2).predict
    inputs = [look(view, CAMERA, "height_map", PARAMS.table).inputs for view in views] * 8
    alone = [predict(one)[0] for one in inputs[:3]] * 8
    with ThreadPoolExecutor(4) as threads:
        for found, expected in zip(threads.map(predict, inputs), alone, strict=True):
            np.testing.assert_array_equal(found[0], expected)


def test_the_same_weights_are_the_same_bytes_and_name_no_file(params, tmp_path):
    network = build_network(params)
    for name in ("one", "other"):
        write_onnx(tmp_path / name, network, params.channels)
    content = (tmp_path / "one").read_bytes()
    assert content == (tmp_path / "other").read_bytes()
    assert str(Path(torch.__file__).parent).encode() not in content and b".py" not in content


def test_the_default_models_two_networks_are_one(views):
    inputs = look(views[0], CAMERA, "height_map", PARAMS.table).inputs
    expected, _ = OneByOne(load_network(DEFAULT))(inputs)
    np.testing.assert_allclose(GraspPlanner.load().predict(inputs)[0], expected, atol=1e-4)


def _another(**changes):
    def spoil(path: Path) -> None:
        params = PARAMS.network["fcn"]
        network = build_network(params.__class__(**(vars(params) | changes)))
        write_onnx(path, network, 1 if changes.get("input") == "depth" else 2)

    return spoil


@pytest.mark.parametrize(
    ("spoil", "believed", "says"),
    [
        (Path.unlink, False, "no such file; `graspfn model export` writes it"),
        (lambda path: (path.unlink(), path.mkdir()), False, "cannot be read"),
        (
            lambda path: path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\n"),
            False,
            "a pointer",
        ),
        (lambda path: path.write_bytes(path.read_bytes()[:-1]), False, "damaged, or of another network"),
        (_another(width=5), False, "damaged, or of another network"),
        (lambda path: path.write_bytes(b"no network"), True, "onnxruntime cannot run it"),
        (lambda path: path.write_bytes(b""), True, "onnxruntime cannot run it"),
        (_another(input="depth"), True, r"takes \[\[1, 1, 132, 176\]\] and gives"),
    ],
)
def test_a_network_that_does_not_fit_is_one_line(spoil, believed, says, tmp_path):
    """believed: config.json has the sha256 of what is there."""
    params = PARAMS.network["fcn"]
    save_model(tmp_path, build_network(params), params)
    spoil(tmp_path / NETWORK)
    if believed:
        config = json.loads((tmp_path / "config.json").read_text())
        config["onnx_sha256"] = hashlib.sha256((tmp_path / NETWORK).read_bytes()).hexdigest()
        (tmp_path / "config.json").write_text(json.dumps(config))
    with pytest.raises(ValueError, match=rf"^{tmp_path}/{NETWORK}: {says}") as caught:
        GraspPlanner.load(tmp_path)
    assert "\n" not in str(caught.value)
