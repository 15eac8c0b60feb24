"""What the true function is good for under physics: robust planning beats the best pose, the right Sigma a wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import trimesh
from physics_params import ATTEMPT, GRIPPER, PARAMS, PHYSICS

from graspfn.evaluation.expected import Attempts, expected_success
from graspfn.geometry import grid
from graspfn.geometry.transforms import translation
from graspfn.meshes.placed import Resting
from graspfn.physics.attempt import Grasper
from graspfn.physics.labelling import held, label_object, successes
from graspfn.physics.world import Rig
from graspfn.planning.methods import best_grasp, robust_best_grasp
from graspfn.planning.robust import RobustFunction
from graspfn.planning.uncertainty import PoseUncertainty

RIG = Rig(PHYSICS, GRIPPER, ATTEMPT)
ATTEMPTS, TRIALS = 3, 80
SMALL, LARGE = PoseUncertainty.of(5.0, 10.0), PoseUncertainty.of(20.0, 10.0)
TURNED = PoseUncertainty.of(5.0, 60.0)


def standing(*size: float) -> Resting:
    box = trimesh.creation.box(size)
    return Resting(box, box, translation(0, 0, size[2] / 2))


# One that holds wherever it is taken, but for its ends, and one that holds where it is taken squarely.
OBJECTS = {"blade": standing(0.02, 0.16, 0.04), "cube": standing(0.055, 0.055, 0.05)}
# The uncertainty that there is, and another that is planned for.
CASES = {"blade": (LARGE, SMALL), "cube": (SMALL, TURNED)}


@dataclass(frozen=True, eq=False)
class Labelled:
    name: str
    f: np.ndarray
    attempts: Attempts
    grasper: Grasper

    def success(self, q: np.ndarray, sigma: PoseUncertainty) -> float:
        errors = np.random.default_rng(5).standard_normal((TRIALS, 3))
        return float(np.mean([self.grasper.run(reached).held for reached in sigma.reached(q, errors)]))

    def robust(self, sigma: PoseUncertainty) -> np.ndarray:
        q = robust_best_grasp(RobustFunction(self.f, sigma), PARAMS.plan, np.random.default_rng(0))
        assert q is not None
        return q


@pytest.fixture(scope="module", params=sorted(OBJECTS))
def labelled(request: pytest.FixtureRequest) -> Labelled:
    labels = label_object(OBJECTS[request.param], ATTEMPTS, RIG, np.random.default_rng(1))
    drawn = grid.sample_cells(ATTEMPTS, np.random.default_rng(1))
    f = successes(labels.outcomes) / ATTEMPTS
    attempts = Attempts(drawn, held(labels.outcomes))
    return Labelled(request.param, f, attempts, Grasper(OBJECTS[request.param], RIG))


def test_planning_with_the_right_uncertainty_beats_the_best_pose_and_a_wrong_uncertainty(labelled: Labelled) -> None:
    there, wrong = CASES[labelled.name]
    best = best_grasp(labelled.f, np.random.default_rng(0))
    assert best is not None
    right = labelled.success(labelled.robust(there), there)
    # Paired: all poses are missed by the same errors.
    assert right > labelled.success(best, there) + 0.1
    assert right > labelled.success(labelled.robust(wrong), there)
    assert right > 0.8


def test_expected_success_is_that_of_trials(labelled: Labelled) -> None:
    """Of poses that were planned on nothing of the object, under every uncertainty; each at four standard errors."""
    poses = np.array([[0.004, -0.003, 0.1], [0.012, 0.02, 0.3]])
    for q in poses:
        for sigma in (SMALL, LARGE, TURNED):
            assert sigma.sigmas is not None
            expected = expected_success(q, *sigma.sigmas[1:], labelled.attempts)
            tried = labelled.success(q, sigma)
            spread = np.hypot(expected.error, np.sqrt(max(tried * (1 - tried), 0.02) / TRIALS))
            assert abs(expected.value - tried) < 4 * spread
