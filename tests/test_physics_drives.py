"""The compiled steps of a hand, against the same in plain Python, bit by bit."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from physics_params import ATTEMPT, GRIPPER, JAW, JAW_ATTEMPT, PHYSICS, touching_poses

from graspfn.geometry.transforms import translation
from graspfn.meshes.placed import Resting
from graspfn.physics import attempt
from graspfn.physics.attempt import Grasper, Outcome
from graspfn.physics.drives import LET_GO
from graspfn.physics.native import POINTER
from graspfn.physics.world import Diverged, GraspWorld, Rig

RING = trimesh.creation.annulus(0.045, 0.06, 0.03)
CONE = trimesh.creation.cone(0.03, 0.04)
CONE.apply_translation(-CONE.center_mass)  # too steep to be held: it is squeezed out
SHAPES = {
    "ring": Resting(RING, RING, translation(0, 0, 0.015)),
    "cone": Resting(CONE, CONE, translation(0, 0, -CONE.bounds[0, 2])),
}
RIGS = {"revolute": Rig(PHYSICS, GRIPPER, ATTEMPT), "prismatic": Rig(PHYSICS, JAW, JAW_ATTEMPT)}


class PlainWorld(GraspWorld):
    """A world that calls dartpy for everything, and counts the steps that it took again."""

    again = 0

    def drive(self, rise: float, steps: int = 1) -> None:
        for _ in range(steps):
            self._step(rise)
            touches = self.world.getLastCollisionResult().inCollision
            palm, left, right = map(touches, self.hand.getBodyNodes())
            self._squeezed, self._touched = left and right, palm or left or right

    def _step(self, rise: float) -> None:
        k = self.kinematics
        POINTER.from_address(self._drives.solver).value = self._drives.tables[int(self._squeezed)]
        limits = np.minimum(self.hand.getVelocities()[1:] + k.acceleration * self.time_step, k.speed)
        if self._squeezed:
            before = self.state()
            self._commanded([rise, LET_GO, LET_GO])
            if (self.hand.getVelocities()[1:] <= limits).all():
                return
            self.restore(before)
            self.again += 1
        self._commanded([rise, *limits])

    def _commanded(self, speeds: list[float]) -> None:
        self.hand.setCommands(speeds)
        self.step()


def plain(monkeypatch: pytest.MonkeyPatch, resting: Resting, rig: Rig) -> Grasper:
    with monkeypatch.context() as patched:
        patched.setattr(attempt, "GraspWorld", PlainWorld)
        return Grasper(resting, rig)


def bits(world: GraspWorld) -> tuple[bytes | bool, ...]:
    *numbers, squeezed = world.state()
    return *(array.tobytes() for array in numbers), squeezed, world.touched()


@pytest.mark.parametrize("whole", [False, True], ids=["stopped", "whole"])
@pytest.mark.parametrize("rig", RIGS.values(), ids=RIGS)
@pytest.mark.parametrize("resting", SHAPES.values(), ids=SHAPES)
def test_compiled_steps_are_those_of_plain_python(
    monkeypatch: pytest.MonkeyPatch, resting: Resting, rig: Rig, whole: bool
) -> None:
    compiled, reference = Grasper(resting, rig), plain(monkeypatch, resting, rig)
    outcomes = set()
    for q in [*touching_poses(resting, 5), np.zeros(3)]:
        found, expected = compiled.run(q, whole), reference.run(q, whole)
        assert (found.outcome, found.early) == (expected.outcome, expected.early)
        assert bits(compiled.world) == bits(reference.world)
        outcomes.add(found.outcome)
    assert outcomes & {Outcome.LEFT, Outcome.HELD}
    assert isinstance(reference.world, PlainWorld) and reference.world.again > 0


@pytest.mark.parametrize("thrown", [np.nan, 1e4])
def test_both_stop_before_a_state_that_has_run_away(monkeypatch: pytest.MonkeyPatch, thrown: float) -> None:
    resting, rig = SHAPES["ring"], RIGS["revolute"]
    worlds = [Grasper(resting, rig).world, plain(monkeypatch, resting, rig).world]
    ends = []
    for world in worlds:
        world.place_object(resting.T_world_object)
        world.place_hand(np.zeros(3))
        world.drive(0.0, 20)
        world.object.setVelocities([0, 0, 0, thrown, 0, 0])
        with pytest.raises(Diverged):
            world.drive(0.0, 20)
        ends.append(bits(world))
    assert ends[0] == ends[1]
