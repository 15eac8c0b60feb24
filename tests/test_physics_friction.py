"""A solver of contacts put in place of DART's: with whatever contacts, and where DART is laid out in another way."""

from __future__ import annotations

from dataclasses import replace

import dartpy as dart
import numpy as np
import pytest
import trimesh
from physics_params import ATTEMPT, GRIPPER, JAW, JAW_ATTEMPT, PHYSICS

from graspfn.geometry.transforms import translation
from graspfn.meshes.placed import Resting
from graspfn.physics import friction
from graspfn.physics.attempt import Grasper, Outcome
from graspfn.physics.world import Rig

ROD = trimesh.creation.cylinder(0.01, segment=[[0, -0.1, 0], [0, 0.1, 0]]).subdivide().subdivide()
RIGS = {"revolute": Rig(PHYSICS, GRIPPER, ATTEMPT), "prismatic": Rig(PHYSICS, JAW, JAW_ATTEMPT)}


@pytest.mark.parametrize("reference", [False, True], ids=["as labelled", "every step"])
@pytest.mark.parametrize("detector", ["ode", "fcl"])
@pytest.mark.parametrize("rig", RIGS.values(), ids=RIGS)
def test_a_rod_does_not_turn_with_any_gripper_and_contacts(rig: Rig, detector: str, reference: bool) -> None:
    """FCL's contacts lie all along the pads where triangles are small; on long ones they may lie in one place."""
    physics = replace(rig.physics, detector=detector, reference=reference)
    grasper = Grasper(Resting(ROD, ROD, translation(0, 0, 0.01)), replace(rig, physics=physics))
    result = grasper.run(np.array([0, 0.02, 0]), film=True)
    axes = np.array([frame.T_world_object[:3, 1] for frame in result.frames])
    assert result.outcome is Outcome.HELD
    assert np.degrees(np.arccos(axes @ axes[0])).max() < 0.5


def test_another_solver_is_refused() -> None:
    reserve = dart.simulation.World("").getConstraintSolver().getSecondaryBoxedLcpSolver()
    with pytest.raises(ImportError, match=r"lays its contact solver out in another way: it takes dartpy 6\.20$"):
        friction.tables(reserve)


def test_another_table_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if `solve` stood elsewhere in it. What is named there would be called with arguments that it does not take."""
    monkeypatch.setattr(friction, "SOLVES", friction.SOLVES - 1)
    with pytest.raises(ImportError, match="in another way"):
        friction._table.__wrapped__()
