"""From recordings to a plan: the Sigma that `graspfn logs` writes is the one that `graspfn plan` takes."""

from __future__ import annotations

import dataclasses
import importlib
import json

import numpy as np
import yaml
from made_bags import TOPICS
from made_models import save_model
from physics_params import PARAMS
from test_plan_command import CAMERA, DEPTH, PINHOLE, network  # noqa: F401
from test_robot_logs import ARM, bag
from typer.testing import CliRunner

from graspfn.cli import app
from graspfn.planning.planner import GraspPlanner
from graspfn.planning.uncertainty import PoseUncertainty


def test_the_covariance_that_is_written_is_what_planning_takes(tmp_path, monkeypatch, network):  # noqa: F811
    """In mm and degrees there, in metres and radians here; correlated, so that nothing diagonal would do."""
    rng, made = np.random.default_rng(1), dataclasses.replace(PARAMS, topics=TOPICS, arm=ARM)
    logs = importlib.import_module("graspfn.commands.logs")
    monkeypatch.setattr(logs, "read_yaml", lambda path: None)
    monkeypatch.setattr(logs, "validate", lambda values: made)
    (tmp_path / "bags").mkdir()
    for i in range(12):
        bag(tmp_path / "bags" / f"trial-{i}.mcap", i, rng)
    result = CliRunner().invoke(app, ["logs", str(tmp_path / "bags"), "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    written = tmp_path / "out/covariance/6.2mm-4.7deg-assumed.yaml"
    content = yaml.safe_load(written.read_text(encoding="utf-8"))
    assert content["units"] == {"u": "mm", "v": "mm", "theta": "deg"}
    scale = np.array([1e-3, 1e-3, np.pi / 180])
    S = np.array(content["covariance"]) * np.outer(scale, scale)
    assert 0.002 < np.sqrt(S[0, 0]) < 0.02 and abs(S - np.diag(np.diag(S))).max() > 0
    np.save(tmp_path / "image.npy", DEPTH)
    model = tmp_path / "model"
    save_model(model, network, PARAMS.network["fcn"])
    base = ["plan", str(tmp_path / "image.npy"), "--model", str(model), *PINHOLE, "--json", "--covariance"]
    answered = CliRunner().invoke(app, [*base, str(written)])
    assert answered.exit_code == 0, answered.output
    told = json.loads(answered.stdout)
    grasp = GraspPlanner.load(model).plan(DEPTH, CAMERA, PoseUncertainty(S), posed=False)
    np.testing.assert_allclose(
        [told["robust_score"], told["table"]["u_m"]], [grasp.robust_score, grasp.q[0]], atol=1e-6
    )
    assert told["robust_score"] < grasp.function.f.max()
    (tmp_path / "none.yaml").write_text(written.read_text(encoding="utf-8").replace("theta: deg", "theta: mm"))
    refused = CliRunner().invoke(app, [*base, str(tmp_path / "none.yaml")])
    assert refused.exit_code == 2 and refused.stderr.count("\n") == 1
    assert refused.stderr.startswith(f"--covariance {tmp_path}/none.yaml: units: takes")
