"""One grasp attempt: close under constant torque, rise 20 cm, still held? (paper III-A, III-C)."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from graspfn.params import LOOK_MS, Attempt
from graspfn.physics.world import Diverged, GraspWorld


class Outcome(enum.StrEnum):
    """How an attempt ended; `HELD` alone is a success."""

    HELD = "held"
    COLLIDED = "collided"  # the open gripper starts inside the object
    UNTOUCHED = "untouched"  # the whole closing goes clear of the resting object: nothing need be simulated
    MISSED = "missed"  # the fingers met each other, not the object
    LEFT = "left"  # the object stayed on, or fell back towards, the table
    DIVERGED = "diverged"  # the simulation ran away: counted apart, and as no success


@dataclass(frozen=True)
class Frame:
    """The state of an attempt at one time, enough to draw it or to record it."""

    time_s: float
    hand_z: float  # rise of the hand, metres
    finger_angles: tuple[float, float]
    T_world_object: np.ndarray  # (4, 4)


Watcher = Callable[[Frame], None]

# Early stops, in simulated time. Each waits until nothing can change any more: they save time, not outcomes.
CHECK_S = LOOK_MS / 1e3  # states are looked at this often
STILL_S = 0.050  # fingers and object still for so long: the rest of the closing changes nothing
LOST_S = 0.060  # no touch for so long while the hand rises: the hand has left 6 mm behind
RIGID_S = 0.120  # object and hand moved as one for so long, off the table: nothing pulls them apart later
CLEAR_M = 5e-3  # an object is off the table from here: landing bodies bounce by less
FAR_M = 5.0  # out of the hand's reach
STILL_M_S, STILL_RAD_S = 2e-3, 4e-2


class Grasper:
    """Runs attempts on one resting object.

    T_world_object: (4, 4) resting pose; every attempt starts from it.
    """

    def __init__(self, world: GraspWorld, T_world_object: np.ndarray, attempt: Attempt):
        self.world, self.attempt, self.T_rest = world, attempt, T_world_object
        self._every = max(1, round(CHECK_S / world.time_step))
        self._free = self._free_closing()

    def run(self, q: np.ndarray, watch: Watcher | None = None, whole: bool = False) -> Outcome:
        """Attempt a grasp at pose q = (u, v, theta), metres and radians.

        `watch` sees the state every 10 ms; `whole` runs every step, without early stops.
        """
        world = self.world
        world.place_object(self.T_rest)
        world.place_hand(q)
        if world.hand_touches_object() or world.hand_inside_object():
            return Outcome.COLLIDED
        self._clock, self._watch, self._whole = 0.0, watch, whole
        self._show()
        if not whole and not self._approach():
            return Outcome.UNTOUCHED
        try:
            if not self._close():
                return Outcome.MISSED
            return Outcome.HELD if self._lift() else Outcome.LEFT
        except Diverged:
            return Outcome.DIVERGED

    def _free_closing(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Positions and velocities of the hand at every look at a closing that meets nothing."""
        far = self.T_rest.copy()
        far[0, 3] += FAR_M
        self.world.place_object(far)
        self.world.place_hand(np.zeros(3))
        states = [(self.world.hand.getPositions(), self.world.hand.getVelocities())]
        for _ in range(round(self.attempt.close_s / CHECK_S)):
            for _ in range(self._every):
                self.world.drive(0.0)
            states.append((self.world.hand.getPositions(), self.world.hand.getVelocities()))
        return states

    def _approach(self) -> bool:
        """Put the fingers where they are just before they touch the object; False if they never do.

        Until then the object rests and the fingers move as if it was not there, so nothing need be simulated. They
        are thicker than they move between two looks, so that no part of the object can pass through unseen.
        """
        hand = self.world.hand
        before = self._free[0]
        for state in self._free[1:]:
            hand.setPositions(state[0])
            if self.world.hand_touches_object():
                hand.setPositions(before[0])
                hand.setVelocities(before[1])
                return True
            before = state
            self._clock += CHECK_S
            self._show()
        return False

    def _advance(self, rise: float) -> None:
        """Run until the next look at the state."""
        for _ in range(self._every):
            self.world.drive(rise)
        self._clock += self._every * self.world.time_step
        self._show()

    def _show(self) -> None:
        if self._watch is not None:
            z, left, right = self.world.hand.getPositions()
            self._watch(Frame(self._clock, float(z), (float(left), float(right)), self.world.object_pose()))

    def _still(self) -> bool:
        """Whether object and fingers move at no more than the speeds that count as still, seen from the hand."""
        hand = self.world.hand.getVelocities()
        linear, angular = self.world.object_velocity()
        linear = linear - [0, 0, hand[0]]
        return bool(
            np.abs(linear).max() < STILL_M_S
            and np.abs(angular).max() < STILL_RAD_S
            and np.abs(hand[1:]).max() < STILL_RAD_S
        )

    def _close(self) -> bool:
        """Close the fingers; False if they met each other without meeting the object."""
        still = 0.0
        for _ in range(round((self.attempt.close_s - self._clock) / CHECK_S)):
            self._advance(0.0)
            closed = self.world.hand.getPositions()[1:] >= self.world.kinematics.closed_angle - 1e-4
            if closed.all() and not self._whole:
                return self.world.hand_touches_object()
            still = still + CHECK_S if self._still() else 0.0
            if still >= STILL_S and not self._whole:
                break
        return True

    def _lift(self) -> bool:
        """Raise the hand; whether the object is off the table and in the gripper at the top."""
        speed = self.attempt.lift_speed_mms / 1e3
        lost = rigid = 0.0
        for _ in range(round(self.attempt.lift_mm / 1e3 / speed / CHECK_S)):
            self._advance(speed)
            if self._whole:
                continue
            lost = 0.0 if self.world.hand_touches_object() else lost + CHECK_S
            if lost >= LOST_S:
                return False
            rigid = rigid + CHECK_S if self._still() else 0.0
            if rigid >= RIGID_S and self.world.lowest_point() > CLEAR_M:
                return True
        return self.world.lowest_point() > CLEAR_M and self.world.hand_touches_object()
