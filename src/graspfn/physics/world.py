"""The DART world of a grasp: a table, one object, and the gripper (paper IV-A)."""

from __future__ import annotations

from dataclasses import dataclass

import dartpy as dart
import numpy as np
import trimesh

from graspfn.geometry.transforms import T_world_grasp, apply
from graspfn.meshes.mass import solid
from graspfn.meshes.placed import Resting
from graspfn.params import Attempt, Gripper, Physics
from graspfn.physics import bodies, contacts
from graspfn.physics.drives import Drives
from graspfn.physics.gripper import Kinematics

DETECTORS = {
    "ode": dart.collision.OdeCollisionDetector,
    "fcl": dart.collision.FCLCollisionDetector,
    "bullet": dart.collision.BulletCollisionDetector,
    "dart": dart.collision.DARTCollisionDetector,
}
State = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, bool]
RESERVE = 100, 1e-9, 1e-6  # iterations at most, and the changes, absolute and relative, that end them before
RUNAWAY_M_S = 10.0  # an object has no more than the energy of this speed and the work of the fingers


class Diverged(RuntimeError):
    """The state has run away: not finite, or of more energy than anything could have given the object."""


@dataclass(frozen=True)
class Rig:
    """What grasps are made with: the parameters of the world, the gripper and the course of an attempt."""

    physics: Physics
    gripper: Gripper
    attempt: Attempt


class TableWorld:
    """One object on a table. States are restored, never rebuilt.

    mesh: metres, origin at the centre of mass; collision: what of it a gripper touches, None where there is none.
    `points`: the (n, 3) hull vertices that stand on the table.
    """

    def __init__(self, mesh: trimesh.Trimesh, physics: Physics, collision: trimesh.Trimesh | None = None):
        contacts.leave_slop()
        self.world = dart.simulation.World("grasp")
        self.world.setTimeStep(physics.time_step_ms / 1e3)
        self.world.setGravity([0, 0, -9.81])
        # A resting object must feel the finger that touches it in the same step.
        sleeping = self.world.getDeactivationOptions()
        sleeping.mEnabled = False
        self.world.setDeactivationOptions(sleeping)
        solver = self.world.getConstraintSolver()
        solver.setCollisionDetector(DETECTORS[physics.detector]())
        # Where Dantzig's method fails, an iterative one takes the step: after 30 iterations, fingers would sink in.
        reserve = dart.constraint.PgsBoxedLcpSolverOption()
        reserve.mMaxIteration, reserve.mDeltaXThreshold, reserve.mRelativeDeltaXTolerance = RESERVE
        solver.getSecondaryBoxedLcpSolver().setOption(reserve)
        # dartpy hands out a copy of the options, but the filter in it is the solver's own.
        self._filter = solver.getCollisionOption().collisionFilter
        self.friction = physics.friction
        self.mesh = mesh
        self.points = bodies.sole(mesh)
        self.object = bodies.free_object(mesh, collision, self.points, physics.density_kgm3)
        self.table = bodies.table()
        self._closed, self._bounds = solid(mesh) is mesh, mesh.bounds
        self._body, self._sole = self.object.getBodyNodes()
        self.max_energy = self.object.getMass() * RUNAWAY_M_S**2 / 2
        for skeleton in (self.table, self.object):
            self._add(skeleton)
        # The mesh meets the gripper alone, the sole the table alone.
        self._filter.addBodyNodePairToBlackList(self._body, self.table.getBodyNode(0))

    def _add(self, skeleton: dart.dynamics.Skeleton) -> None:
        bodies.set_friction(skeleton, self.friction)
        self.world.addSkeleton(skeleton)

    @property
    def time_step(self) -> float:
        """Seconds."""
        return float(self.world.getTimeStep())

    def place_object(self, T_world_object: np.ndarray) -> None:
        """Put the object at rest at T_world_object (4, 4)."""
        self.object.setPositions(dart.dynamics.FreeJoint.convertToPositions(T_world_object))
        self.object.setVelocities(np.zeros(6))

    def object_pose(self) -> np.ndarray:
        """T_world_object: (4, 4)."""
        return np.asarray(self._body.getWorldTransform().matrix())

    def object_velocity(self) -> tuple[np.ndarray, np.ndarray]:
        """Linear (3,) m/s of the centre of mass and angular (3,) rad/s velocity, world axes."""
        return self._body.getLinearVelocity(), self._body.getAngularVelocity()

    def lowest_point(self) -> float:
        """Height of the object's lowest point, metres."""
        T = self.object_pose()
        return float((self.points @ T[2, :3]).min() + T[2, 3])

    def step(self) -> None:
        """One time step. Raises Diverged instead of stepping a state that has run away."""
        # ODE aborts the whole process on such a state, so it never gets to see one. NaN fails the test too.
        if not self.object.computeKineticEnergy() < self.max_energy:
            raise Diverged(self._run_away)
        self.world.step()

    @property
    def _run_away(self) -> str:
        return f"object of more than {self.max_energy:.2g} J"


class GraspWorld(TableWorld):
    """One object on a table under a gripper."""

    def __init__(self, resting: Resting, physics: Physics, gripper: Gripper):
        super().__init__(resting.mesh, physics, resting.collision)
        if physics.detector == "ode":
            contacts.thin_out()
        self.kinematics = Kinematics.from_params(gripper)
        self.max_energy += 2 * self.kinematics.effort * (self.kinematics.closed - self.kinematics.open)
        self.hand = bodies.hand(self.kinematics)
        self._add(self.hand)
        self._hand_bodies = self.hand.getBodyNodes()
        speed, spurt = self.kinematics.speed, self.kinematics.acceleration * self.time_step
        self._drives = Drives(self.world, self.hand, self.object, speed, spurt, self.max_energy)
        for body in self._hand_bodies:
            self._filter.addBodyNodePairToBlackList(self._sole, body)
            self._filter.addBodyNodePairToBlackList(self.table.getBodyNode(0), body)
        self._hand_group = self._group(self._hand_bodies)
        self._object_group = self._group([self._body])

    def _group(self, group_bodies: list[dart.dynamics.BodyNode]) -> dart.collision.CollisionGroup:
        group = self.world.getConstraintSolver().getCollisionDetector().createCollisionGroup()
        for body in group_bodies:
            group.addShapeFramesOf(body)
        return group

    def place_hand(self, q: np.ndarray) -> None:
        """Put the hand, fingers open and at rest, at pose q = (u, v, theta)."""
        self.hand.getJoint(0).setTransformFromParentBodyNode(dart.math.Isometry3(T_world_grasp(q)))
        self.hand.setPositions([0.0, self.kinematics.open, self.kinematics.open])
        self.hand.setVelocities(np.zeros(3))
        self._squeezed = self._touched = False

    def state(self) -> State:
        """All that the next step depends on, to be restored bit by bit."""
        positions = self.hand.getPositions(), self.object.getPositions()
        return *positions, self.hand.getVelocities(), self.object.getVelocities(), self._squeezed

    def restore(self, state: State) -> None:
        hand, body, hand_velocities, body_velocities, self._squeezed = state
        self.hand.setPositions(hand)
        self.object.setPositions(body)
        self.hand.setVelocities(hand_velocities)
        self.object.setVelocities(body_velocities)

    def hand_touches_object(self) -> bool:
        """Whether palm or fingers meet the object's surface in the present state."""
        return bool(self._hand_group.collide(self._object_group))

    def hand_inside_object(self) -> bool:
        """Whether palm or a finger lies wholly inside a closed object, where no surfaces meet."""
        if not self._closed:
            return False
        shapes = (body.getShapeNode(0) for body in self._hand_bodies)
        centres = np.array([shape.getWorldTransform().translation() for shape in shapes])
        centres = apply(np.linalg.inv(self.object_pose()), centres)
        low, high = self._bounds
        centres = centres[((centres > low) & (centres < high)).all(axis=1)]
        return len(centres) > 0 and bool(self.mesh.contains(centres).any())

    def drive(self, rise: float, steps: int = 1) -> None:
        """Time steps with the effort on both fingers, no faster than drives allow, the hand rising at `rise` (m/s).

        Raises Diverged instead of stepping a state that has run away.
        """
        self._squeezed, self._touched, sane = self._drives.run(rise, steps, self._squeezed)
        if not sane:
            raise Diverged(self._run_away)

    def touched(self) -> bool:
        """Whether palm or fingers met the object in the last step; at less cost than `hand_touches_object`."""
        return self._touched
