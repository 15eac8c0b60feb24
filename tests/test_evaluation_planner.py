"""What is evaluated is what a user's planner commands: to the bit, on the same image with the same function."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from physics_params import GRIPPER, PARAMS
from test_planning_planner import CAMERA, PLANNER, block, placed, post_predictor, seen

from graspfn.evaluation.bench import Scene
from graspfn.evaluation.planner import TRUE, UNTRAINED, GraspFunction, Planned, Planner, view
from graspfn.geometry import grid
from graspfn.imaging.camera import straight_down
from graspfn.planning.methods import BEST, CENTROID, ROBUST
from graspfn.planning.planner import Grasp, GraspPlanner, Method, NoGrasp
from graspfn.planning.uncertainty import PoseUncertainty

SIGMAS = [PoseUncertainty.of(5, 10), PoseUncertainty.of(20, 40), PoseUncertainty.of(0.5, 1)]
NAMES = {Method.CENTROID: CENTROID, Method.BEST: BEST, Method.ROBUST: ROBUST}


def noise(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A network that has learned nothing, and is as sure beside the object as on it."""
    scores = np.random.default_rng(int(1e4 * abs(float(inputs.sum())))).random(grid.SHAPE, dtype=np.float32)
    return scores, np.rint(5 * scores).astype(np.uint8)


def evaluated(planner: GraspPlanner, depth: np.ndarray) -> list[list[Planned]]:
    """As stages predict and evaluate do it: the function first, then the poses under every uncertainty."""
    own, table = view(depth, CAMERA, planner.input, planner.table), planner.table
    scores = np.zeros(grid.SHAPE, np.float32) if own.inputs is None else planner.predict(own.inputs)[0]
    function = GraspFunction("net", 0, scores).where_met(own.seen, planner.gripper)
    scene = Scene("scene", view(depth, CAMERA, "height_map", table).seen, np.zeros(2), 0.0)
    return Planner(planner.refinement, 0).plans(scene, [function], SIGMAS)


@pytest.mark.parametrize("kind", ["height_map", "depth"])
@pytest.mark.parametrize("predict", [post_predictor, noise])
def test_the_poses_are_those_of_the_planner(predict, kind):
    planner = dataclasses.replace(PLANNER, predict=predict, input=kind)
    for i in range(3):
        depth = seen(CAMERA, placed((0.05 - 0.04 * i, 0.02 * i), 0.7 * i)[0])
        for sigma, plans in zip(SIGMAS, evaluated(planner, depth), strict=True):
            poses = {planned.method: planned for planned in plans}
            for method, name in NAMES.items():
                if kind == "depth" and method is Method.CENTROID:
                    continue  # evaluate's plans on the table that is found, whatever networks see
                grasp = planner.plan(depth, CAMERA, sigma, method)
                assert isinstance(grasp, Grasp), grasp.reason
                np.testing.assert_array_equal(poses[name].q, grasp.q)
                if method is not Method.CENTROID:
                    assert poses[name].promise == pytest.approx(grasp.robust_score, rel=1e-12)


REFUSED = {
    "several objects": (seen(CAMERA, block(-0.05, 0), block(0.05, 0)), "several objects"),
    "cut": (seen(CAMERA, block(0.22, 0)), "the object leaves the view"),
    "no table": (np.zeros((480, 640), np.float32), "depth image"),
    "elsewhere": (seen(CAMERA.at(straight_down(0.6)), block(0, 0)), "table"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_an_image_that_is_refused_is_no_grasp_of_any_method(name):
    """But the true function's, which is about the object and not the image."""
    depth, says = REFUSED[name]
    planner = dataclasses.replace(PLANNER, predict=noise)
    found = planner.plan(depth, CAMERA, SIGMAS[0])
    own = view(depth, CAMERA, "height_map", planner.table)
    assert isinstance(found, NoGrasp) and found.reason == own.refused and found.reason.startswith(says)
    assert all(planned.q is None for plans in evaluated(planner, depth) for planned in plans)
    f = np.zeros(grid.SHAPE)
    f[10:20, 10:20, 2] = 1
    scene = Scene("scene", own.seen, np.zeros(2), 0.0)
    (plans,) = Planner(PARAMS.plan, 0).plans(scene, [GraspFunction(TRUE, UNTRAINED, f)], SIGMAS[:1])
    assert {planned.method for planned in plans if planned.q is not None} == {BEST, ROBUST}


def test_the_likeliest_class_is_limited_like_the_scores():
    depth = seen(CAMERA, placed((0.05, 0.02), 0.3)[0])
    own = view(depth, CAMERA, "height_map", PARAMS.table)
    everywhere = GraspFunction("net", 0, np.ones(grid.SHAPE), np.ones(grid.SHAPE)).where_met(own.seen, GRIPPER)
    assert everywhere.likeliest is not None
    np.testing.assert_array_equal(everywhere.f, everywhere.likeliest)
    assert 0 < everywhere.f.mean() < 0.5
