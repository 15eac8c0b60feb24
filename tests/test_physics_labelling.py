"""Labels of one object: every attempt accounted for, attempts that run away tried again, the slow reference agrees."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from physics_params import ATTEMPT, GRIPPER, PARAMS, PHYSICS

from graspfn.geometry import grid
from graspfn.geometry.transforms import translation
from graspfn.meshes.placed import Resting
from graspfn.physics.attempt import Grasper, Outcome
from graspfn.physics.labelling import ENDS, OUTCOMES, RETRIED, Labels, held, joined, label_object
from graspfn.physics.world import GraspWorld, Rig

BRIEF = replace(ATTEMPT, lift_mm=20)
RIG = Rig(PHYSICS, GRIPPER, BRIEF)
HALF = replace(RIG, physics=replace(PHYSICS, time_step_ms=PHYSICS.time_step_ms / 2))
BALL = trimesh.creation.icosphere(1, 0.012)
SMALL = Resting(BALL, BALL, translation(0, 0, -BALL.bounds[0, 2]))
ONE_ANGLE = slice(0, 1)
SQUARELY, FAR_AWAY = np.zeros(3), np.array([0.0, 0.2, 0.0])


def labels(rig: Rig = RIG, angles: slice = ONE_ANGLE) -> Labels:
    return label_object(SMALL, 1, rig, np.random.default_rng(0), angles)


def check_sums(found: Labels, attempts: int) -> None:
    account = found.account
    assert set(account) == {*OUTCOMES, *ENDS, RETRIED}
    assert sum(account[outcome] for outcome in OUTCOMES) == attempts
    simulated = sum(account[outcome] for outcome in ("held", "left", "missed", "diverged"))
    assert sum(account[end] for end in ENDS) == simulated == found.simulated
    assert account["ran_away"] == account["diverged"] <= account[RETRIED]
    assert account["held"] == found.successes.sum() == held(found.outcomes).sum()
    assert np.bincount(found.outcomes.ravel(), minlength=len(OUTCOMES)).tolist() == [account[o] for o in OUTCOMES]


@pytest.fixture
def run_away(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Throws the object of worlds whose time step is at least so many milliseconds, as the hand sets off."""
    drive = GraspWorld.drive

    def from_step(step_ms: float) -> None:
        def thrown(world: GraspWorld, rise: float, steps: int = 1) -> None:
            if rise and world.time_step >= step_ms / 1e3:
                world.object.setVelocities([0, 0, 0, np.nan, 0, 0])
            drive(world, rise, steps)

        monkeypatch.setattr(GraspWorld, "drive", thrown)

    return from_step


@pytest.mark.parametrize(
    ("q", "whole", "outcome"),
    [(SQUARELY, False, Outcome.HELD), (SQUARELY, True, Outcome.HELD), (FAR_AWAY, True, Outcome.LEFT)],
    ids=["held", "held, whole", "left, whole"],
)
def test_what_runs_away_has_the_end_it_has_at_half_the_step(
    run_away: Callable[[float], None], q: np.ndarray, whole: bool, outcome: Outcome
) -> None:
    expected = Grasper(SMALL, HALF).run(q, whole)
    assert expected.outcome is outcome
    run_away(PHYSICS.time_step_ms)
    found = Grasper(SMALL, RIG).run(q, whole)
    assert (found.outcome, found.early, found.retried) == (outcome, expected.early, True)


def test_what_runs_away_twice_is_no_success_and_leaves_no_trace(
    run_away: Callable[[float], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    grasper = Grasper(SMALL, RIG)

    def final() -> tuple[bool, bytes]:
        return grasper.run(SQUARELY).held, grasper.world.object_pose().tobytes()

    before = final()
    run_away(0)
    result = grasper.run(SQUARELY)
    assert (result.outcome, result.retried, result.held) == (Outcome.DIVERGED, True, False)
    monkeypatch.undo()
    assert before[0] and final() == before


def test_attempts_that_run_away_once_are_labelled_as_at_half_the_step(run_away: Callable[[float], None]) -> None:
    expected = labels(HALF)
    run_away(PHYSICS.time_step_ms)
    found = labels()
    check_sums(found, found.successes.size)
    assert found.account["held"] > 0 and found.account["diverged"] == 0
    assert found.account[RETRIED] >= found.account["held"] + found.account["left"]
    # Where the fingers meet before the hand sets off, nothing runs away.
    draws = grid.sample_cells(1, np.random.default_rng(0))[:, :, ONE_ANGLE, 0]
    grasper = Grasper(SMALL, RIG)
    set_off = [grasper.run(q).outcome is not Outcome.MISSED for q in draws.reshape(-1, 3)]
    assert np.array_equal(found.successes, expected.successes * np.reshape(set_off, draws.shape[:-1]))


def test_attempts_that_run_away_twice_are_counted_and_never_labelled(run_away: Callable[[float], None]) -> None:
    run_away(0)
    found = labels()
    check_sums(found, found.successes.size)
    assert not found.successes.any()
    assert found.account["diverged"] > 0


def test_every_attempt_is_accounted_for_whole_and_in_parts() -> None:
    found = labels(angles=slice(0, 2))
    assert found.successes.shape == (*grid.SHAPE[:2], 2)
    check_sums(found, found.successes.size)
    seen = ("held", "collided", "untouched", "missed", "stopped_failed", "ran_to_end")
    assert all(found.account[key] for key in seen)
    parts = joined([labels(angles=slice(0, 1)), labels(angles=slice(1, 2))])
    assert parts.account == found.account and np.array_equal(parts.outcomes, found.outcomes)
    assert PARAMS.label.attempts * np.prod(grid.SHAPE) == 43560


def test_the_slow_reference_simulates_everything_and_agrees(monkeypatch: pytest.MonkeyPatch) -> None:
    sample = grid.sample_cells
    monkeypatch.setattr(grid, "sample_cells", lambda *given: sample(*given)[10:23, 14:30])  # the middle, for time
    reference = replace(RIG, physics=replace(PHYSICS, reference=True))
    slow, fast = labels(reference), labels()
    check_sums(slow, slow.successes.size)
    assert slow.account["untouched"] == slow.account["stopped_failed"] == slow.account["stopped_held"] == 0
    assert slow.account["ran_to_end"] == slow.successes.size - slow.account["collided"]
    assert slow.account["collided"] == fast.account["collided"]
    near = (slow.successes > 0) | (fast.successes > 0)
    assert near.sum() >= 5 and np.mean(slow.successes[near] == fast.successes[near]) >= 0.9
    assert np.mean(slow.successes == fast.successes) >= 0.97


def test_poses_of_attempts_follow_from_the_seed_by_the_raw_bits_alone() -> None:
    # The pieces that numpy promises never to change: how a seed starts PCG64, and its stream.
    bits = np.random.PCG64(7).random_raw(np.prod(grid.SHAPE) * 2 * 3) >> np.uint64(11)
    offset = (bits / 2.0**53 - 0.5).reshape(*grid.SHAPE, 2, 3) * [grid.CELL_M, grid.CELL_M, grid.CELL_RAD]
    drawn = grid.sample_cells(2, np.random.default_rng(7))
    assert np.array_equal(drawn, grid.poses()[..., None, :] + offset)
    uniform = np.random.default_rng(7).uniform(-0.5, 0.5, offset.shape) * [grid.CELL_M, grid.CELL_M, grid.CELL_RAD]
    assert np.array_equal(drawn, grid.poses()[..., None, :] + uniform)  # as labels have always been drawn
