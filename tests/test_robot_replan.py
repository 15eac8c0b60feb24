"""Planning a recording again: the pose that the planner commanded on its image, or why there is none."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from physics_params import GRIPPER, PARAMS
from test_planning_planner import CAMERA, block, placed, seen
from test_robot_recording import trial

from graspfn.evaluation.planner import Planner
from graspfn.learning.networks import build_network
from graspfn.learning.prediction import OneByOne
from graspfn.learning.weights import load_network, save_network
from graspfn.planning.methods import BEST, ROBUST
from graspfn.planning.planner import Grasp, GraspPlanner, Method
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.robot.replan import Replanner
from graspfn.robot.trial import TrialRecording

NETWORK = build_network(PARAMS.network["fcn"], 0).eval()


@pytest.fixture(scope="module")
def again(tmp_path_factory) -> Replanner:
    folder = tmp_path_factory.mktemp("networks") / "fcn-0"
    save_network(folder, NETWORK, PARAMS.network["fcn"])
    return Replanner({"fcn": folder}, Planner(PARAMS.plan, 0), CAMERA, PARAMS.table, GRIPPER)


def recorded(depth: np.ndarray, method: str, q: np.ndarray | None) -> TrialRecording:
    made = trial()
    condition = dataclasses.replace(made.condition, method=method, network="fcn", sigma_uv_mm=5.0, sigma_theta_deg=10.0)
    return dataclasses.replace(
        made, condition=condition, depth=depth, camera_matrix=CAMERA.matrix, distortion=(), commanded=q
    )


@pytest.mark.parametrize(("method", "name"), [(Method.BEST, BEST), (Method.ROBUST, ROBUST)])
def test_it_is_the_pose_that_the_planner_commanded(method, name, again):
    depth = seen(CAMERA, placed((0.05, 0.02), 0.7)[0])
    network = OneByOne(load_network(again.networks["fcn"]))
    planner = GraspPlanner(network, "height_map", GRIPPER, PARAMS.table, PARAMS.plan)
    grasp = planner.plan(depth, CAMERA, PoseUncertainty.of(5, 10), method)
    assert isinstance(grasp, Grasp), grasp.reason
    planned = again.replan(recorded(depth, name, grasp.q))
    assert planned is not None
    np.testing.assert_array_equal(planned.q, grasp.q)
    np.testing.assert_array_equal(planned.f, grasp.function.f)
    np.testing.assert_array_equal(planned.robust, grasp.function.on_q)
    assert planned.differs(grasp.q) == ""
    assert planned.differs(None) == "planned again, a grasp is found"


@pytest.mark.parametrize(
    ("depth", "says"),
    [
        (seen(CAMERA, block(-0.05, 0), block(0.05, 0)), "several objects: 2"),
        (np.zeros((480, 640), np.float32), "depth image: 0 of the pixels"),
    ],
)
def test_an_image_that_is_refused_says_why(depth, says, again):
    planned = again.replan(recorded(depth, ROBUST, None))
    assert planned is not None and planned.q is None and not planned.f.any() and not planned.robust.any()
    assert planned.differs(None) == ""
    assert planned.differs(np.zeros(3)).startswith(f"planned again, no grasp is found: {says}")
