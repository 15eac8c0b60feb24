"""Grasp attempts at every pose of Q of one object (paper IV-C)."""

from __future__ import annotations

import functools
import gc
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from graspfn.geometry import grid
from graspfn.meshes.placed import Resting
from graspfn.physics.attempt import Grasper, Outcome, Result
from graspfn.physics.culling import touches_nothing
from graspfn.physics.world import Rig

ALL = slice(None)
OUTCOMES = tuple(outcome.value for outcome in Outcome)
# How the simulated attempts ended: these four add up to the outcomes missed, left, held and diverged.
ENDS = ("stopped_failed", "stopped_held", "ran_to_end", "ran_away")
RETRIED = "retried"  # ran away at first, and were run again with half the step


@dataclass(frozen=True)
class Labels:
    """How every attempt on one object ended.

    outcomes: (33, 44, 6, attempts) uint8, places in OUTCOMES, of the attempts at the poses of `grid.sample_cells`.
    account: of the 8712 x attempts, how many had each of OUTCOMES, which add up to all; how many of those that were
    simulated had each of ENDS; and how many were RETRIED.
    """

    outcomes: np.ndarray
    account: dict[str, int]

    @property
    def successes(self) -> np.ndarray:
        """The grasp function, counted: (33, 44, 6) uint8, attempts that held at each pose."""
        return successes(self.outcomes)

    @property
    def simulated(self) -> int:
        """Attempts that were neither culled nor started inside the object."""
        return sum(self.account[end] for end in ENDS)


def label_object(resting: Resting, attempts: int, rig: Rig, rng: np.random.Generator, angles: slice = ALL) -> Labels:
    """Attempt `attempts` grasps in the cell of every pose of Q.

    `angles` picks some of Q's angles: labels of an object may be made in parts, which `joined` puts together.
    """
    _freeze_imports()
    grasper = Grasper(resting, rig)
    draws = grid.sample_cells(attempts, rng)[:, :, angles]
    q = draws.reshape(-1, 3)
    culled = touches_nothing(resting, q, grasper.world.kinematics) & (not rig.physics.reference)
    outcomes = np.full(len(q), OUTCOMES.index(Outcome.UNTOUCHED), dtype=np.uint8)
    account = dict.fromkeys((*OUTCOMES, *ENDS, RETRIED), 0)
    account[Outcome.UNTOUCHED] += int(culled.sum())
    for i in np.flatnonzero(~culled):
        result = grasper.run(q[i])
        outcomes[i] = OUTCOMES.index(result.outcome)
        account[result.outcome.value] += 1
        for entry in end(result):
            account[entry] += 1
    return Labels(outcomes.reshape(draws.shape[:-1]), account)


def held(outcomes: np.ndarray) -> np.ndarray:
    """Which attempts held the object: bool, of the shape of the outcomes."""
    return outcomes == OUTCOMES.index(Outcome.HELD)


def successes(outcomes: np.ndarray) -> np.ndarray:
    """Attempts that held at each pose, uint8: (..., attempts) -> (...)."""
    return held(outcomes).sum(axis=-1, dtype=np.uint8)


def end(result: Result) -> list[str]:
    """The entries of the account, besides its outcome, that an attempt counts in."""
    retried = [RETRIED] * result.retried
    if result.outcome in (Outcome.UNTOUCHED, Outcome.COLLIDED):
        return retried
    stopped = "stopped_held" if result.held else "stopped_failed"
    ended = "ran_away" if result.outcome is Outcome.DIVERGED else stopped if result.early else "ran_to_end"
    return [ended, *retried]


@functools.cache
def _freeze_imports() -> None:
    """The collector would walk every imported module again and again: a tenth of the time."""
    gc.collect()
    gc.freeze()


def joined(parts: Sequence[Labels]) -> Labels:
    """The labels of an object from those of its angles, in order."""
    account = {entry: sum(part.account[entry] for part in parts) for entry in parts[0].account}
    return Labels(np.concatenate([part.outcomes for part in parts], axis=2), account)
