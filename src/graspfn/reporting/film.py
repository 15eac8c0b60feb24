"""A simulated grasp to look at: which attempt to film, and its moments (paper, Fig. 3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from graspfn.geometry import grid
from graspfn.geometry.transforms import T_world_grasp, translation
from graspfn.params import Attempt, Gripper, Physics
from graspfn.physics.attempt import Frame, Grasper, Outcome
from graspfn.physics.world import GraspWorld

HIGH_M = 0.05
TRIES = 20  # poses of an object; a pose with score 1 holds nearly always at its cell's centre


@dataclass(frozen=True, eq=False)
class Shot:
    """One moment: T_world_object (4, 4), and palm and fingers as (T_world_box (4, 4), size (3,))."""

    title: str
    T_world_object: np.ndarray
    boxes: tuple[tuple[np.ndarray, np.ndarray], ...]


@dataclass(frozen=True, eq=False)
class Film:
    """A grasp of the object `id` at pose q (3,); `mesh` in metres about its centre of mass."""

    id: str
    mesh: trimesh.Trimesh
    q: np.ndarray
    outcome: str
    shots: tuple[Shot, ...]


def poses_to_try(successes: np.ndarray) -> np.ndarray:
    """(TRIES, 3) poses of Q, highest score first and then nearest the image centre; successes: (33, 44, 6)."""
    q = grid.poses().reshape(-1, 3)
    order = np.lexsort([np.hypot(q[:, 0], q[:, 1]), -successes.ravel().astype(int)])
    return q[order[:TRIES]]


def _shot(title: str, frame: Frame, q: np.ndarray, world: GraspWorld) -> Shot:
    T_world_hand = T_world_grasp(q) @ translation(0, 0, frame.hand_z)
    boxes = tuple((T_world_hand @ T, size) for T, size in world.kinematics.parts(frame.finger_angles))
    return Shot(title, frame.T_world_object, boxes)


def moments(frames: list[Frame]) -> list[tuple[str, Frame]]:
    """Start, closed, 5 cm up and the top of a whole attempt."""
    closed = [frame for frame in frames if frame.hand_z < 1e-6][-1]
    high = next((frame for frame in frames if frame.hand_z >= HIGH_M), frames[-1])
    top = frames[-1]
    return [
        ("hand in place", frames[0]),
        ("fingers closed", closed),
        (f"{100 * HIGH_M:g} cm up", high),
        (f"{100 * top.hand_z:.0f} cm up", top),
    ]


def film_grasp(
    name: str,
    mesh: trimesh.Trimesh,
    collision: trimesh.Trimesh,
    T_world_object: np.ndarray,
    successes: np.ndarray,
    physics: Physics,
    gripper: Gripper,
    attempt: Attempt,
) -> Film | None:
    """The first attempt that holds, of the poses that labelling found best; None where none of them does.

    mesh is what is seen and has the mass, collision what is touched; successes: (33, 44, 6).
    """
    world = GraspWorld(mesh, collision, physics, gripper)
    grasper = Grasper(world, T_world_object, attempt)
    for q in poses_to_try(successes):
        frames: list[Frame] = []
        outcome = grasper.run(q, frames.append, whole=True)
        if outcome is Outcome.HELD:
            shots = tuple(_shot(title, frame, q, world) for title, frame in moments(frames))
            return Film(name, mesh, q, outcome.value, shots)
    return None
