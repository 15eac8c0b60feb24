"""The steepest taper that two fingers hold: arctan μ by Coulomb's law, whatever the mass (docs/physics.md).

    python benchmarks/wedge.py

Two fingers close on a wedge, as it is seen from above; too steep, it slides out. DART's solver bounds the friction of a
step by the normal forces that there would be in it without friction. Then a light wedge would fly out, and fingers that
are heavier than it, or may not go so fast, would hardly press on it: hence light fingers, which GraspWorld lets go.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from unittest import mock

import numpy as np
import pandas as pd
import trimesh
from mujoco_grasp import MujocoGrasper
from objects import committed, rig_of

from graspfn.geometry.transforms import translation
from graspfn.meshes.placed import Resting
from graspfn.physics.attempt import Grasper, Result
from graspfn.physics.drives import Drives
from graspfn.physics.gripper import Kinematics
from graspfn.physics.world import Rig

WIDTH_M, LENGTH_M, HEIGHT_M = 0.045, 0.030, 0.025
STEEPEST_DEG, HALVINGS = 50.0, 7
OUT_M = 5e-3  # a wedge that has moved so far by the end of the closing slides out
MASSES_KG = (0.003, 0.010, 0.030, 0.100, 0.300)


def wedge(degrees: float) -> Resting:
    """A wedge on the table whose sides lean `degrees` from the hand's y axis."""
    corners = [
        (side * (WIDTH_M / 2 + y * np.tan(np.radians(degrees))), y, z)
        for side in (-1, 1)
        for y in (-LENGTH_M / 2, LENGTH_M / 2)
        for z in (0.0, HEIGHT_M)
    ]
    mesh = trimesh.Trimesh(corners).convex_hull
    mesh.apply_translation(-mesh.center_mass)
    return Resting(mesh, mesh, translation(0, 0, -mesh.bounds[0, 2]))


def steepest(make: Callable[[Resting, Rig], Callable[..., Result]], mass: float, rig: Rig) -> float:
    """The taper, degrees, at which a wedge of `mass` begins to slide out; STEEPEST_DEG where none does."""
    held, out = 0.0, STEEPEST_DEG
    for _ in range(HALVINGS):
        degrees = (held + out) / 2
        resting = wedge(degrees)
        density = replace(rig.physics, density_kgm3=mass / resting.mesh.volume)
        frames = make(resting, replace(rig, physics=density))(np.zeros(3), film=True).frames
        moved = np.hypot(*(frames[-1].T_world_object - resting.T_world_object)[:2, 3])
        held, out = (degrees, out) if moved < OUT_M else (held, degrees)
    return held


def predicted(mass: float, rig: Rig) -> float:
    """The same in closed form, with friction bounded by μ times the normal force that there would be without it.

    Without friction, N (cos β + 2 M/m tan β sin β) = F: M follows the wedge, which two faces accelerate by 2 N sin β.
    """
    k = Kinematics.from_params(rig.gripper)
    finger = k.inertia / k.length**2 if k.turns else k.inertia
    beta = np.radians(np.arange(0.1, 90, 0.1))
    normal = 1 / (np.cos(beta) + 2 * finger / mass * np.tan(beta) * np.sin(beta))
    return float(np.degrees(beta[np.argmax(rig.physics.friction * normal < np.sin(beta))]))


def _kept(grasper: Grasper, q: np.ndarray, film: bool) -> Result:
    """As if the fingers were never let go when they squeeze an object."""
    run = Drives.run

    def kept(drives: Drives, rise: float, steps: int, squeezed: bool) -> tuple[bool, bool, bool]:
        return [run(drives, rise, 1, squeezed=False) for _ in range(steps)][-1]

    with mock.patch.object(Drives, "run", kept):
        return grasper.run(q, whole=True, film=film)


def main() -> None:
    rig = rig_of(committed())
    rig = replace(rig, attempt=replace(rig.attempt, lift_mm=rig.attempt.lift_speed_mms / 100))
    engines: dict[str, Callable[[Resting, Rig], Callable[..., Result]]] = {
        "DART": lambda resting, rig: functools.partial(Grasper(resting, rig).run, whole=True),
        "limits always kept": lambda resting, rig: functools.partial(_kept, Grasper(resting, rig)),
        "MuJoCo": lambda resting, rig: MujocoGrasper(resting, rig).run,
    }
    rows = []
    for mass in MASSES_KG:
        row = {"mass, g": mass * 1e3, "bounds without friction": predicted(mass, rig)}
        row |= {name: steepest(make, mass, rig) for name, make in engines.items()}
        rows.append(row | {"Coulomb": np.degrees(np.arctan(rig.physics.friction))})
    print(f"steepest taper, degrees, at {rig.physics.time_step_ms:g} ms, friction {rig.physics.friction:g}")
    print(pd.DataFrame(rows).round(1).to_string(index=False))


if __name__ == "__main__":
    main()
