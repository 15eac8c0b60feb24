"""The simulated robot (paper V-B with DART for a table): sees, plans, misses by Sigma, grasps, and records it all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from graspfn.evaluation.trials import Bench, Planned, Sigma
from graspfn.geometry.camera import Intrinsics
from graspfn.imaging.noise import add_noise
from graspfn.meshes.placed import Resting
from graspfn.params import Noise
from graspfn.physics.attempt import Frame
from graspfn.physics.world import Rig
from graspfn.robot.depth_holes import hole_mask
from graspfn.robot.trial import Condition, TrialRecording
from graspfn.workflow.seeds import generator

JOINTS = ("hand_lift", "finger_left", "finger_right")


@dataclass(frozen=True, eq=False)
class Scene:
    """One object at one placement, and what the robot's camera made of it.

    depth: (480, 640) float32, metres, NaN where nothing was measured.
    """

    object: str
    placement: int
    shift_uv: np.ndarray
    theta: float
    depth: np.ndarray


def see(depth: np.ndarray, noise: Noise, intrinsics: Intrinsics, rng: np.random.Generator) -> np.ndarray:
    """A noise-free (480, 640) image as the robot's camera gives it: eq. 2's noise, NaN where nothing was measured."""
    seen = add_noise(depth, noise, rng).astype(np.float32)
    seen[hole_mask(depth, intrinsics, rng)] = np.nan
    return seen


def record(
    scene: Scene,
    plans: list[tuple[Sigma, Planned]],
    resting: Resting,
    rig: Rig,
    intrinsics: Intrinsics,
    seed: int,
) -> list[TrialRecording]:
    """Execute every plan on the scene. Plans of one uncertainty share the arm's error, so that methods are paired.

    Where a method found no grasp the robot stays where it is, and that is recorded as the failure it is.
    """
    bench = Bench(resting, rig)
    recordings = []
    for sigma, planned in plans:
        reached: np.ndarray | None = None
        frames: tuple[Frame, ...] = ()
        held = False
        if planned.q is not None:
            rng = generator(seed, "record_robot", scene.object, scene.placement, sigma.uv_mm, sigma.theta_deg)
            reached = sigma.reached(planned.q, rng)
            result = bench.grasp(reached, scene.shift_uv, scene.theta, film=True)
            held, frames = result.held, result.frames
        recordings.append(
            TrialRecording(
                condition=Condition(
                    object=scene.object,
                    placement=str(scene.placement),
                    method=planned.method,
                    network=planned.network,
                    sigma_uv_mm=sigma.uv_mm,
                    sigma_theta_deg=sigma.theta_deg,
                    simulated=True,
                ),
                depth=scene.depth,
                camera_matrix=intrinsics.matrix,
                commanded=planned.q,
                achieved=reached,
                joint_names=JOINTS,
                joint_time_s=np.array([frame.time_s for frame in frames]),
                joint_positions=np.array([(frame.hand_z, *frame.fingers) for frame in frames]).reshape(-1, 3),
                success=held,
            )
        )
    return recordings


def file_name(condition: Condition) -> str:
    """A file name that tells the trial: object, placement, uncertainty, method and network."""
    method = "-".join(filter(None, (condition.method.lower().replace(" ", "_"), condition.network)))
    sigma = f"{condition.sigma_uv_mm:g}mm-{condition.sigma_theta_deg:g}deg"
    return f"{condition.object}-p{condition.placement}-{sigma}-{method}.mcap"
