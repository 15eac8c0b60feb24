"""Grasp worlds that look at their own contacts, and that can meet an object in several pieces."""

from __future__ import annotations

import functools
import time
from collections.abc import Sequence
from unittest import mock

import dartpy as dart
import numpy as np
import trimesh

from graspfn.geometry.transforms import T_world_grasp, apply, translation
from graspfn.meshes.placed import Resting
from graspfn.params import LOOK_MS, Gripper, Physics
from graspfn.physics import attempt, bodies
from graspfn.physics.attempt import Grasper, Result
from graspfn.physics.world import GraspWorld, Rig

PROBES = 5000  # points of the surface, besides its vertices, that are looked for inside the hand
NOTHING_M = 1e-4  # contacts no deeper are not looked at


class WatchedWorld(GraspWorld):
    """A world that keeps how many contacts its worst step had, and how deep hand and object were in each other.

    pieces: meshes that together are what a gripper touches.
    """

    def __init__(self, resting: Resting, physics: Physics, gripper: Gripper, pieces: Sequence[trimesh.Trimesh]):
        super().__init__(resting, physics, gripper)
        for piece in pieces[1:]:
            shape = bodies.free_object(resting.mesh, piece, self.points, 1.0).getBodyNode(0).getShapeNode(0).getShape()
            node = self._body.createShapeNode(shape)
            node.createCollisionAspect()
            node.createDynamicsAspect()
        bodies.set_friction(self.object, self.friction)
        self._object_group = self._group([self._body])
        if physics.detector == "dart":
            self._stand_on_a_box()
        self._surface = _points_on(pieces)
        self._looks = max(1, round(LOOK_MS / 1e3 / self.time_step))
        self.forget(np.zeros(3))

    def _stand_on_a_box(self) -> None:
        """DART's own detector lets a mesh fall through a half-space."""
        table = self.table.getBodyNode(0)
        table.removeAllShapeNodes()
        node = table.createShapeNode(dart.dynamics.BoxShape([2, 2, 0.2]))
        node.setRelativeTranslation([0, 0, -0.1])
        node.createCollisionAspect()
        node.createDynamicsAspect()
        bodies.set_friction(self.table, self.friction)

    def forget(self, q: np.ndarray) -> None:
        """Begin anew, with the hand at pose q."""
        self._T_hand, self._steps, self._deeper = T_world_grasp(q), 0, False
        self.contacts = 0  # most of any step, in all the world
        self.said = 0.0  # deepest contact of hand and object that the detector reported, m
        self.depth = 0.0  # and as measured, at every look and at the step after a new deepest report
        self.watching = 0.0  # seconds of processor time that all this took

    def place_hand(self, q: np.ndarray) -> None:
        super().place_hand(q)
        self.forget(q)

    def drive(self, rise: float, steps: int = 1) -> None:
        for _ in range(steps):
            started = time.process_time()
            if self._deeper or self._steps % self._looks == 0:
                self.depth = max(self.depth, self._measured())
            self.watching += time.process_time() - started
            super().drive(rise)
            started = time.process_time()
            contacts = self.world.getLastCollisionResult().getContacts()
            self.contacts = max(self.contacts, len(contacts))
            self._steps += 1
            deeper = [c for c in contacts if c.penetrationDepth > max(self.said, NOTHING_M) and _of_hand(c)]
            self.said, self._deeper = max([self.said, *(c.penetrationDepth for c in deeper)]), bool(deeper)
            self.watching += time.process_time() - started

    def _measured(self) -> float:
        """How deep the deepest point of the object's surface lies in palm or finger, m; 0 where none does.

        The way out of a box is through its nearest face. An edge of the hand that cuts into a flat face of the object
        is deeper than that by up to the square root of 2, a corner by that of 3.
        """
        z, left, right = self.hand.getPositions()
        parts = self.kinematics.parts((left, right))
        points = apply(np.linalg.inv(self._T_hand @ translation(0, 0, z)) @ self.object_pose(), self._surface)
        points = points[np.abs(points[:, 1]) < max(size[1] for _, size in parts) / 2]  # few, for the sake of time
        inside = [(size / 2 - np.abs(apply(np.linalg.inv(T), points))).min(axis=1) for T, size in parts]
        return float(max(np.max(inside, initial=0.0), 0.0))


def _of_hand(contact: dart.collision.Contact) -> bool:
    """Whether a contact is one of hand and object: the table meets the sole alone."""
    pair = (contact.collisionObject1, contact.collisionObject2)
    return not any(one.getShapeFrame().getName().startswith("sole") for one in pair)


def _points_on(pieces: Sequence[trimesh.Trimesh]) -> np.ndarray:
    """(n, 3) vertices and evenly drawn points of all surfaces together."""
    areas = np.array([piece.area for piece in pieces])
    counts = np.ceil(PROBES * areas / areas.sum()).astype(int)
    drawn = [trimesh.sample.sample_surface(piece, n, seed=0)[0] for piece, n in zip(pieces, counts, strict=True)]
    return np.vstack([*(piece.vertices for piece in pieces), *drawn])


class WatchedGrasper(Grasper):
    """A Grasper in such a world."""

    world: WatchedWorld

    def __init__(self, resting: Resting, rig: Rig, pieces: Sequence[trimesh.Trimesh] = ()):
        self.pieces = pieces or [resting.collision]
        resting = Resting(resting.mesh, self.pieces[0], resting.T_world_object)
        with mock.patch.object(attempt, "GraspWorld", functools.partial(WatchedWorld, pieces=self.pieces)):
            super().__init__(resting, rig)

    def run(self, q: np.ndarray, whole: bool | None = None, film: bool = False) -> Result:
        with mock.patch.object(attempt, "Grasper", functools.partial(WatchedGrasper, pieces=self.pieces)):
            return super().run(q, whole, film)  # a retry makes another grasper, which has to be like this one
