"""Time steps of a closing or rising hand, compiled: in Python, DART would wait a third of the time for its caller."""

from __future__ import annotations

import ctypes
import functools
from typing import Any

import dartpy as dart
import numba
import numpy as np

from graspfn.physics import friction
from graspfn.physics.native import POINTER, address, function

LET_GO = 1e6  # rad/s or m/s, to which no effort brings a finger in a step
HAND, LEFT, RIGHT = range(3)  # parts of the hand, and its degrees of freedom, which the object's follow


class Drives:
    """The drives of a hand on a vertical slide with two fingers.

    solver: address of the solver of contacts, which begins with one of `tables` (friction.tables), in every step anew;
    speed: at most, of the fingers; spurt: by how much it may grow in a step; both rad/s or m/s. max_energy: joule.
    """

    def __init__(
        self,
        world: dart.simulation.World,
        hand: dart.dynamics.Skeleton,
        body: dart.dynamics.Skeleton,
        speed: float,
        spurt: float,
        max_energy: float,
    ):
        dofs = [*hand.getDofs(), *body.getDofs()]
        parts = hand.getBodyNodes()  # palm, left and right finger
        solver = world.getConstraintSolver().getBoxedLcpSolver()
        self._alive = world, hand, body, dofs, parts, solver
        self.solver, self.tables = address(solver), friction.tables(solver)
        last_result = function("_ZNK4dart10simulation5World22getLastCollisionResultEv", POINTER, POINTER)
        self._arguments = (
            address(world),
            last_result(address(world)),
            self.solver,
            self.tables,
            address(body),
            np.array([address(part) for part in parts], dtype=np.uintp),
            np.array([address(dof) for dof in dofs], dtype=np.uintp),
            speed,
            spurt,
            max_energy,
        )

    def run(self, rise: float, steps: int, squeezed: bool) -> tuple[bool, bool, bool]:
        """Time steps with the effort on both fingers, no faster than drives allow, the hand rising at `rise` (m/s).

        squeezed: whether both fingers met the object in the step before. Returns the same of the last step; whether
        any part of the hand did; and whether the object has stayed below max_energy: as soon as it does not, no more
        steps are taken.
        """
        return _compiled()(*self._arguments, float(rise), steps, squeezed)


@functools.cache
def _compiled() -> Any:
    of_dof, real = "dart8dynamics15DegreeOfFreedom", ctypes.c_double
    position = function(f"_ZNK4{of_dof}11getPositionEv", real, POINTER)
    velocity = function(f"_ZNK4{of_dof}11getVelocityEv", real, POINTER)
    set_position = function(f"_ZN4{of_dof}11setPositionEd", None, POINTER, real)
    set_velocity = function(f"_ZN4{of_dof}11setVelocityEd", None, POINTER, real)
    command = function(f"_ZN4{of_dof}10setCommandEd", None, POINTER, real)
    energy = function("_ZNK4dart8dynamics8Skeleton20computeKineticEnergyEv", real, POINTER)
    step = function("_ZN4dart10simulation5World4stepEb", None, POINTER, ctypes.c_int)
    copy = function("memcpy", None, POINTER, POINTER, POINTER)
    touches = function(
        "_ZNK4dart9collision15CollisionResult11inCollisionEPKNS_8dynamics8BodyNodeE", ctypes.c_uint8, POINTER, POINTER
    )

    @numba.njit
    def commanded(world, body, dofs, max_energy, rise, left, right):  # type: ignore[no-untyped-def]
        """One time step with the speeds of hand, left and right finger commanded; False, not taken, if run away."""
        if not energy(body) < max_energy:  # NaN fails the test too
            return False
        command(dofs[HAND], rise)
        command(dofs[LEFT], left)
        command(dofs[RIGHT], right)
        step(world, 1)
        return True

    @numba.njit
    def drive(  # type: ignore[no-untyped-def]
        world, last_result, solver, tables, body, parts, dofs, speed, spurt, max_energy, rise, steps, squeezed
    ):
        # DART bounds friction by the normal forces that there would be without it. Without it an object between two
        # fingers may escape, and fingers that follow no faster than their drives allow would hardly press on it. So
        # they are let go, and the step is taken again where friction did not hold them; and friction is bounded by the
        # normal forces of contacts that stick, for as long as both fingers touch the object (docs/physics.md).
        positions, velocities = np.empty(len(dofs)), np.empty(len(dofs))
        for _ in range(steps):
            left = min(velocity(dofs[LEFT]) + spurt, speed)
            right = min(velocity(dofs[RIGHT]) + spurt, speed)
            held = False
            copy(solver, tables.ctypes.data + squeezed * friction.WORD, friction.WORD)
            if squeezed:
                for i, dof in enumerate(dofs):
                    positions[i], velocities[i] = position(dof), velocity(dof)
                if not commanded(world, body, dofs, max_energy, rise, LET_GO, LET_GO):
                    return squeezed, squeezed, False
                held = velocity(dofs[LEFT]) <= left and velocity(dofs[RIGHT]) <= right
                if not held:
                    for i, dof in enumerate(dofs):
                        set_position(dof, positions[i])
                    for i, dof in enumerate(dofs):
                        set_velocity(dof, velocities[i])
            if not held and not commanded(world, body, dofs, max_energy, rise, left, right):
                return squeezed, squeezed, False
            squeezed = touches(last_result, parts[LEFT]) != 0 and touches(last_result, parts[RIGHT]) != 0
        touched = squeezed
        for part in parts:
            touched = touched or touches(last_result, part) != 0
        return squeezed, touched, True

    return drive
