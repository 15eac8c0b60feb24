"""The simulated robot (paper VII-B with DART for a table): sees, plans, misses by Sigma, grasps, and records it all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from graspfn.evaluation.bench import Scene
from graspfn.evaluation.planner import Planned
from graspfn.imaging.camera import Camera
from graspfn.imaging.noise import add_noise
from graspfn.meshes.placed import Resting
from graspfn.params import Noise
from graspfn.physics.attempt import Grasper, Outcome
from graspfn.physics.world import Rig
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.robot.depth_holes import hole_mask
from graspfn.robot.gantry import ABOVE_M, JOINTS, Gantry, Motion
from graspfn.robot.trial import Condition, TrialRecording
from graspfn.seeds import generator

DESCENT_M = 0.002  # steps by which the open gripper is tried on its way down


@dataclass(frozen=True, eq=False)
class Seen:
    """One object at one placement, and what the robot's camera made of it.

    raw: (height, width) float32, metres, NaN where nothing was measured.
    """

    object: str
    placement: int
    raw: np.ndarray
    scene: Scene


def see(depth: np.ndarray, noise: Noise, camera: Camera, rng: np.random.Generator) -> np.ndarray:
    """A noise-free (480, 640) image as the robot's camera gives it: eq. 2's noise, NaN where nothing was measured."""
    seen = add_noise(depth, noise, rng).astype(np.float32)
    seen[hole_mask(depth, camera, rng)] = np.nan
    return seen


def record(
    seen: Seen,
    cells: Sequence[tuple[float, float]],
    plans: Sequence[Sequence[Planned]],
    resting: Resting,
    rig: Rig,
    camera: Camera,
    seed: int,
) -> list[TrialRecording]:
    """Execute the plans for each cell (sigma_uv [mm], sigma_theta [deg]). Those of one cell share the arm's error, so
    that methods are paired.

    Where a method found no grasp the robot stays where it is, and that is recorded as the failure it is. Failures are
    recorded to the end: no grasp is cut short for being lost.
    """
    grasper, arm = Grasper(resting, rig), Gantry(camera, rig.gripper)
    recordings = []
    for cell, planned in ((cell, planned) for cell, of_cell in zip(cells, plans, strict=True) for planned in of_cell):
        reached: np.ndarray | None = None
        motion, held = arm.waits(), False
        if planned.q is not None:
            error = generator(seed, "record_robot", seen.object, seen.placement, *cell).standard_normal(3)
            reached = PoseUncertainty.of(*cell).reached(planned.q, error)
            motion, held = execute(grasper, arm, reached, seen.scene.unmoved(reached))
        recordings.append(
            TrialRecording(
                condition=Condition(
                    object=seen.object,
                    placement=str(seen.placement),
                    method=planned.method,
                    network=planned.network,
                    sigma_uv_mm=cell[0],
                    sigma_theta_deg=cell[1],
                    simulated=True,
                    injected_uv_mm=cell[0],
                    injected_theta_deg=cell[1],
                ),
                depth=seen.raw,
                camera_matrix=camera.matrix,
                commanded=planned.q,
                achieved=reached,
                joint_names=JOINTS,
                joint_time_s=motion.time_s,
                joint_positions=motion.positions,
                success=held,
                distortion=camera.distortion,
            )
        )
    return recordings


def execute(grasper: Grasper, arm: Gantry, reached: np.ndarray, q: np.ndarray) -> tuple[Motion, bool]:
    """How the arm moves to the pose it reaches and grasps there, and whether it holds the object at the top.

    reached (3,): on the table; q: the same about the object where it was settled. An open gripper that meets the object
    on its way down stops there.
    """
    result = grasper.run(q, whole=True, film=True)
    stopped = stopped_at(grasper, q) if result.outcome is Outcome.COLLIDED else 0.0
    return arm.grasps(reached, stopped, result.frames), result.held


def stopped_at(grasper: Grasper, q: np.ndarray) -> float:
    """The lowest rise [m] that the open gripper comes down to over q without meeting the object."""
    world = grasper.world
    world.place_object(grasper.resting.T_world_object)
    world.place_hand(q)
    free = ABOVE_M
    for rise in np.arange(ABOVE_M, -DESCENT_M / 2, -DESCENT_M):
        world.hand.setPosition(0, rise)
        if world.hand_touches_object() or world.hand_inside_object():
            break
        free = float(rise)
    return free


def file_name(condition: Condition) -> str:
    """A file name that tells the trial: object, placement, uncertainty, method and network."""
    method = "-".join(filter(None, (condition.method.lower().replace(" ", "_"), condition.network)))
    sigma = f"{condition.sigma_uv_mm:g}mm-{condition.sigma_theta_deg:g}deg"
    return f"{condition.object}-p{condition.placement}-{sigma}-{method}.mcap"
