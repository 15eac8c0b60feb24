"""A simulated grasp to look at: which attempt to film, and its moments (paper, Fig. 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from graspfn.geometry import grid
from graspfn.geometry.transforms import T_world_grasp, translation
from graspfn.meshes.placed import Resting
from graspfn.physics.attempt import Frame, Grasper, Outcome
from graspfn.physics.world import GraspWorld, Rig

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
    boxes = tuple((T_world_hand @ T, size) for T, size in world.kinematics.parts(frame.fingers))
    return Shot(title, frame.T_world_object, boxes)


def moments(frames: Sequence[Frame]) -> list[tuple[str, Frame]]:
    """Start, closed, 5 cm up and the top of a whole attempt; none of one that collided or ran away."""
    if not frames:
        return []
    closed = [frame for frame in frames if frame.hand_z < 1e-6][-1]
    high = next((frame for frame in frames if frame.hand_z >= HIGH_M), frames[-1])
    top = frames[-1]
    return [
        ("hand in place", frames[0]),
        ("fingers closed", closed),
        (f"{100 * HIGH_M:g} cm up", high),
        (f"{100 * top.hand_z:.0f} cm up", top),
    ]


def film_grasp(name: str, grasper: Grasper, q: np.ndarray) -> Film:
    """Every moment of the attempt at pose q (3,)."""
    result = grasper.run(q, whole=True, film=True)
    shots = tuple(_shot(title, frame, q, grasper.world) for title, frame in moments(result.frames))
    return Film(name, grasper.resting.mesh, q, result.outcome.value, shots)


def film_failure(name: str, resting: Resting, successes: np.ndarray, rig: Rig, rng: np.random.Generator) -> Film | None:
    """An attempt that touches the object and does not hold it, at a random one of the poses where none ever held.

    successes: (33, 44, 6).
    """
    grasper = Grasper(resting, rig)
    for q in rng.permutation(grid.poses()[successes == 0]):
        if grasper.run(q).outcome in (Outcome.MISSED, Outcome.LEFT):
            return film_grasp(name, grasper, q)
    return None


def film_best_grasp(name: str, resting: Resting, successes: np.ndarray, rig: Rig) -> Film | None:
    """The first attempt that holds, of the poses that labelling found best; None where none of them does.

    successes: (33, 44, 6).
    """
    grasper = Grasper(resting, rig)
    films = (film_grasp(name, grasper, q) for q in poses_to_try(successes))
    return next((seen for seen in films if seen.outcome == Outcome.HELD), None)
