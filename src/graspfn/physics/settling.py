"""Letting an object come to rest on the table before it is seen and grasped."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from graspfn.geometry.transforms import apply
from graspfn.meshes.placed import RESTING
from graspfn.params import Physics, Settle
from graspfn.physics.contacts import SLOP_M
from graspfn.physics.world import Diverged, TableWorld

LOOK_S = 0.020
REST_S = 0.2  # slower than the limits below for so long: at rest
REST_M_S, REST_RAD_S = 2e-3, 2e-2
SUNK_M = 2 * SLOP_M  # deeper in the table, it is still being pushed out
FAR_M = 1.0
FALLEN_M = -0.020  # a corner that lands sinks in by millimetres, and with it the middle of a card; below this, it fell
ROLLING_S = 1.0  # time constant of the resistance that stops a rolling body; rigid contacts have none


@dataclass(frozen=True)
class Settled:
    """Where an object came to rest: `status` is "resting", or the reason why not.

    T_world_object: (4, 4), the middle of the footprint's bounding box over the world's origin.
    """

    status: str
    T_world_object: np.ndarray


def settle(mesh: trimesh.Trimesh, physics: Physics, settling: Settle, rng: np.random.Generator) -> Settled:
    """Drop the object in a uniformly random orientation; mesh in metres about its centre of mass."""
    world = TableWorld(mesh, physics)
    T = np.eye(4)
    T[:3, :3] = Rotation.random(rng=rng).as_matrix()
    T[2, 3] = settling.drop_mm / 1e3 - (world.points @ T[2, :3]).min()
    world.place_object(T)
    rest = 0.0
    looks = round(settling.limit_s / LOOK_S)
    try:
        for _ in range(looks):
            for _ in range(round(LOOK_S / world.time_step)):
                world.step()
            world.object.setVelocities(world.object.getVelocities() * np.exp(-LOOK_S / ROLLING_S))
            T = world.object_pose()
            if T[2, 3] < FALLEN_M or np.abs(T[:2, 3]).max() > FAR_M:
                return Settled("fell through the table" if T[2, 3] < FALLEN_M else "rolled away", T)
            linear, angular = world.object_velocity()
            slow = np.abs(linear).max() < REST_M_S and np.abs(angular).max() < REST_RAD_S
            # A corner that lands first sinks in, and DART takes its time to push it out again: an object may be slow
            # for long before it lies flat.
            slow = slow and world.lowest_point() > -SUNK_M
            rest = rest + LOOK_S if slow else 0.0
            if rest >= REST_S:
                T[2, 3] -= world.lowest_point()  # the solver lets a landing body sink in by a fraction of a millimetre
                return Settled(RESTING, centred(mesh, T))
    except Diverged as error:
        return Settled(str(error), T)
    return Settled(f"never came to rest in {settling.limit_s:g} s", T)


def centred(mesh: trimesh.Trimesh, T_world_object: np.ndarray) -> np.ndarray:
    """T_world_object (4, 4) moved so that the footprint's bounding box is centred on the origin."""
    footprint = apply(T_world_object, mesh.vertices)[:, :2]
    T = T_world_object.copy()
    T[:2, 3] -= (footprint.min(axis=0) + footprint.max(axis=0)) / 2
    return T
