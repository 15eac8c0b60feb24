"""One grasp attempt: close under constant torque, rise 20 cm, still held? (paper IV-A, IV-C)."""

from __future__ import annotations

import enum
from collections import deque
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from graspfn.meshes.placed import Resting
from graspfn.params import LOOK_MS
from graspfn.physics.world import Diverged, GraspWorld, Rig, State


class Outcome(enum.StrEnum):
    """How an attempt ended; `HELD` alone is a success."""

    HELD = "held"
    COLLIDED = "collided"  # the open gripper starts inside the object
    UNTOUCHED = "untouched"  # closing and rising go clear of the resting object: nothing need be simulated
    MISSED = "missed"  # the fingers met each other, not the object
    LEFT = "left"  # the object stayed on, or fell back towards, the table
    DIVERGED = "diverged"  # the simulation ran away, at half the step as well: counted apart, and as no success


@dataclass(frozen=True)
class Frame:
    """The state of an attempt at one time, enough to draw it or to record it."""

    time_s: float
    hand_z: float  # rise of the hand, metres
    fingers: tuple[float, float]  # positions of their joints
    T_world_object: np.ndarray  # (4, 4)


@dataclass(frozen=True, eq=False)
class Result:
    """The end of an attempt.

    early: stopped before its time, since nothing could change any more; retried: ran away once, and this is the end at
    half the step; frames: every 10 ms, where they were asked for.
    """

    outcome: Outcome
    early: bool = False
    retried: bool = False
    frames: tuple[Frame, ...] = ()

    @property
    def held(self) -> bool:
        return self.outcome is Outcome.HELD


# Early stops. Each waits until nothing can change any more: they save time, not outcomes (docs/physics.md).
CHECK_S = LOOK_MS / 1e3  # states are looked at this often
LOST_S = 0.050  # no touch for so long while the hand rises
HALF = 5  # looks: how far the object moves in the hand is compared over twice so many
GRIP_M = 0.2e-3  # it stays there if it will move no farther than this until the top
LEVER_M = np.array([0.1, 0.1, 0.1, 1, 1, 1])  # turning counts 10 cm from the axis: about as far as an object reaches
CLOSED = 1e-4  # of a joint's range short of its stop
CLEAR_M = 5e-3  # an object is off the table from here: landing bodies bounce by less
RISE_M = 0.010  # steps by which the hand is tried on its way up: fingers are thicker than they widen over one
FAR_M = 5.0  # out of the hand's reach


class Grasper:
    """Runs attempts on one resting object, each from the same state."""

    def __init__(self, resting: Resting, rig: Rig):
        self.resting, self.rig, self.attempt = resting, rig, rig.attempt
        self.world = GraspWorld(resting, rig.physics, rig.gripper)
        self._every = max(1, round(CHECK_S / self.world.time_step))
        self._free = self._free_closing()
        kinematics = self.world.kinematics
        self._stride = max(1, int(kinematics.thickness / 2 / (kinematics.arm * kinematics.speed * CHECK_S)))

    def run(self, q: np.ndarray, whole: bool | None = None, film: bool = False) -> Result:
        """Attempt a grasp at pose q = (u, v, theta), metres and radians.

        `whole` runs every step, without early stops, as `physics.reference` asks by default; `film` keeps the frames.
        """
        whole = self.rig.physics.reference if whole is None else whole
        try:
            return self._run(q, whole, film)
        except Diverged:
            pass
        try:
            return replace(self._at_half_the_step._run(q, whole, film), retried=True)
        except Diverged:
            return Result(Outcome.DIVERGED, retried=True)

    @cached_property
    def _at_half_the_step(self) -> Grasper:
        physics = replace(self.rig.physics, time_step_ms=self.rig.physics.time_step_ms / 2)
        return Grasper(self.resting, replace(self.rig, physics=physics))

    def _run(self, q: np.ndarray, whole: bool, film: bool) -> Result:
        world = self.world
        world.place_object(self.resting.T_world_object)
        world.place_hand(q)
        if world.hand_touches_object() or world.hand_inside_object():
            return Result(Outcome.COLLIDED)
        self._clock, self._whole = 0.0, whole
        self._frames: list[Frame] | None = [] if film else None
        self._show()
        if not whole and not self._approach() and self._passes_by():
            return Result(Outcome.UNTOUCHED)
        closing = self._close()
        outcome, early = (Outcome.MISSED, True) if closing is False else self._lift()
        return Result(outcome, early, frames=tuple(self._frames or ()))

    def _free_closing(self) -> list[State]:
        """States at every look at a closing that meets nothing."""
        self.world.place_object(self.resting.T_world_object)
        self.world.place_hand(np.array([FAR_M, 0, 0]))
        states = [self.world.state()]
        for _ in range(round(self.attempt.close_s / CHECK_S)):
            self.world.drive(0.0, self._every)
            states.append(self.world.state())
        return states

    def _approach(self) -> bool:
        """Go to the state just before the closing fingers touch the object; False, shut, if they never do.

        Until then hand and object move as if the other was not there, so nothing need be simulated.
        """
        touch = self._first_touch()
        before = self._free[:touch]
        if self._frames is not None:
            for state in before[1:]:
                self.world.restore(state)
                self._clock += CHECK_S
                self._show()
        self.world.restore(before[-1])
        self._clock = (len(before) - 1) * CHECK_S
        return touch is not None

    def _first_touch(self) -> int | None:
        """The look at which the closing fingers first touch the object; None if they never do.

        Between two looks that are tried, fingers move by half their thickness: nothing passes through them unseen.
        """
        far, last = 0, len(self._free) - 1
        while far < last:
            near, far = far, min(far + self._stride, last)
            if self._touches_at(far):
                return next(look for look in range(near + 1, far + 1) if self._touches_at(look))
        return None

    def _touches_at(self, look: int) -> bool:
        self.world.restore(self._free[look])
        return self.world.hand_touches_object()

    def _advance(self, rise: float) -> None:
        """Run until the next look at the state."""
        self.world.drive(rise, self._every)
        self._clock += CHECK_S
        self._show()

    def _show(self) -> None:
        if self._frames is not None:
            z, left, right = self.world.hand.getPositions()
            self._frames.append(Frame(self._clock, float(z), (float(left), float(right)), self.world.object_pose()))

    def _passes_by(self) -> bool:
        """Whether the hand, as it is, would rise to the top without touching the object, as that is."""
        state = self.world.state()
        z = state[0][0]
        try:
            while z < self.attempt.lift_mm / 1e3:
                if self.world.hand_touches_object():
                    return False
                z += RISE_M
                self.world.hand.setPosition(0, z)
            return True
        finally:
            self.world.restore(state)

    def _close(self) -> bool:
        """Close the fingers; False if they met each other and can no longer meet the object."""
        kinematics = self.world.kinematics
        shut = kinematics.closed - CLOSED * (kinematics.closed - kinematics.open)
        for _ in range(round((self.attempt.close_s - self._clock) / CHECK_S)):
            self._advance(0.0)
            if not self._whole and (self.world.hand.getPositions()[1:] > shut).all() and self._passes_by():
                return False
        return True

    def _lift(self) -> tuple[Outcome, bool]:
        """Raise the hand: held, if the object is off the table and in the gripper at the top; and whether early."""
        speed = self.attempt.lift_speed_mms / 1e3
        looks = round(self.attempt.lift_mm / 1e3 / speed / CHECK_S)
        grips: deque[np.ndarray] = deque(maxlen=HALF + 1)
        moves: deque[float] = deque(maxlen=HALF + 1)  # of the object in the hand, over HALF looks
        lost = 0.0
        for left in reversed(range(looks)):
            self._advance(speed)
            if self._whole or not left:
                continue
            lost = 0.0 if self.world.touched() else lost + CHECK_S
            if lost >= LOST_S and self._passes_by():
                return Outcome.LEFT, True
            grips.append(self._grip())
            if len(grips) > HALF:
                moves.append(float(np.abs(grips[-1] - grips[0]).max()))
            if len(moves) > HALF and yet_to_move(moves[0], moves[-1], left / HALF) < GRIP_M and self._off_the_table():
                return Outcome.HELD, True
        held = self._off_the_table() and self.world.hand_touches_object()
        return Outcome.HELD if held else Outcome.LEFT, False

    def _off_the_table(self) -> bool:
        return self.world.lowest_point() > CLEAR_M

    def _grip(self) -> np.ndarray:
        """(6,) rotation vector of the object, by LEVER_M, and its place in the hand, metres.

        Rotation vectors differ by no less than the turn between them: none is overlooked.
        """
        grip = self.world.object.getPositions() * LEVER_M
        grip[5] -= self.world.hand.getPosition(0)
        return grip


def yet_to_move(before: float, now: float, spans: float) -> float:
    """How far a grip will move in so many spans to come, if it goes on slowing down as it does, metres.

    before, now: how far it moved over the last span but one and over the last. What creeps is mostly DART's correction
    of penetrations, which dies away exponentially.
    """
    ratio = max(now / before, 0.5) if now < before else 1.0  # not trusted to stop at once
    return now * (spans if ratio == 1.0 else ratio * (1 - ratio**spans) / (1 - ratio))
