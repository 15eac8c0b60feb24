"""The simulated robot: what it records of a trial, and that methods share its arm's error."""

from __future__ import annotations

import numpy as np
import physics_params
import pytest

from graspfn.evaluation.bench import Scene
from graspfn.evaluation.planner import Planned
from graspfn.geometry.grid import angle_difference
from graspfn.imaging.camera import Camera
from graspfn.params import Noise
from graspfn.physics.attempt import Frame, Outcome, Result
from graspfn.physics.world import Rig
from graspfn.robot import simulated
from graspfn.robot.simulated import Seen, file_name, record, see

CAMERA = Camera.of_the_paper(640, 480, 570.0)
CELLS = [(6.2, 4.7), (20.0, 15.0)]
OF_CELL = [
    Planned("Centroid", "", -1, np.array([0.02, 0.03, 0.1])),
    Planned("Best Grasp", "fcn", 0, np.array([-0.1, 0.05, 3.1])),
    Planned("Robust Best Grasp", "fcn", 0, np.array([0.0, -0.06, 1.6])),
]
PLANS = [(cell, planned) for cell in CELLS for planned in OF_CELL]


RIG = Rig(physics_params.PHYSICS, physics_params.GRIPPER, physics_params.ATTEMPT)


class Grasper:
    """Holds whatever it is asked to grasp on the left of the object; remembers what that was."""

    asked: list[np.ndarray]

    def __init__(self, resting, rig):
        Grasper.asked = []

    def run(self, q, whole=None, film=False):
        assert whole and film
        Grasper.asked.append(q)
        frames = tuple(Frame(0.01 * i, 0.1 * i, (0.5 * i, 0.7 * i), np.eye(4)) for i in range(5))
        return Result(Outcome.HELD if q[0] < 0 else Outcome.LEFT, frames=frames)


@pytest.fixture
def recorded(monkeypatch):
    """(object, placement, seed) -> the recordings of PLANS."""
    monkeypatch.setattr(simulated, "Grasper", Grasper)

    def made(name="cup", placement=0, seed=0):
        raw = np.full((480, 640), 0.4, np.float32)
        seen = Seen(name, placement, raw, Scene(f"{name}-{placement}", raw, np.array([0.01, 0.02]), 0.4))
        return record(seen, CELLS, [OF_CELL, OF_CELL], None, RIG, CAMERA, seed)

    return made


def errors(recordings) -> np.ndarray:
    """(n, 3) reached less commanded."""
    reached, sent = (np.array([getattr(r, key) for r in recordings]) for key in ("achieved", "commanded"))
    return np.column_stack([reached[:, :2] - sent[:, :2], angle_difference(reached[:, 2], sent[:, 2])])


def test_a_recording_says_what_was_tried_and_what_came_of_it(recorded):
    made = recorded(placement=3)
    scene = Scene("", None, np.array([0.01, 0.02]), 0.4)
    for (cell, planned), q, one in zip(PLANS, Grasper.asked, made, strict=True):
        c = one.condition
        assert (c.object, c.placement, c.method, c.network) == ("cup", "3", planned.method, planned.network)
        assert (c.sigma_uv_mm, c.sigma_theta_deg, c.simulated) == (*cell, True)
        np.testing.assert_array_equal(one.commanded, planned.q)
        np.testing.assert_array_equal(scene.unmoved(one.achieved), q)
        assert one.success == (q[0] < 0)
    assert {one.success for one in made} == {True, False}
    assert len({file_name(one.condition) for one in [*made, *recorded(placement=4), *recorded("jug")]}) == 18


def test_methods_share_the_arms_error_and_nothing_else_does(recorded):
    apart = []
    for made in (recorded(), recorded(placement=1), recorded("jug"), recorded(seed=1)):
        for (uv_mm, theta_deg), cell in zip(CELLS, (errors(made[:3]), errors(made[3:])), strict=True):
            np.testing.assert_allclose(cell, cell[:1].repeat(3, axis=0), atol=1e-12)
            apart.append(cell[0] / [uv_mm / 1e3, uv_mm / 1e3, np.radians(theta_deg)])
    for axis in np.transpose(apart):
        assert np.diff(np.sort(axis)).min() > 1e-9
    assert np.all(abs(np.array(apart)) < 5)


def test_the_camera_errs_as_eq_2_says_and_loses_the_shadow_of_an_object():
    depth = np.full((480, 640), CAMERA.table_depth, np.float32)
    depth[200:280, 300:340] -= 0.1
    seen = see(depth, Noise(0.0, 1.5), CAMERA, np.random.default_rng(0))
    assert seen.dtype == np.float32
    lost = np.isnan(seen)
    assert lost[200:280].sum() > 10 * lost[:80].sum()
    np.testing.assert_allclose((seen - depth)[~lost].std(), 0.0015, rtol=0.01)
