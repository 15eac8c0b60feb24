"""An object on the table at one placement: as a camera sees it, and to try grasps on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from graspfn.geometry.transforms import move_pose, unmove_pose
from graspfn.imaging.height_map import HeightMap
from graspfn.meshes.placed import Resting
from graspfn.physics.attempt import Grasper, Result
from graspfn.physics.world import Rig


@dataclass(frozen=True, eq=False)
class Scene:
    """One object at one placement: turned by theta from where it was settled and labelled, then shifted by (u, v).

    seen: what the camera shows of it; shift_uv: (2,) metres; theta: radians.
    """

    name: str
    seen: HeightMap
    shift_uv: np.ndarray
    theta: float

    def moved(self, q: np.ndarray) -> np.ndarray:
        """Poses (..., 3) about the object where it was settled, as poses in the image."""
        return move_pose(q, self.shift_uv, self.theta)

    def unmoved(self, q: np.ndarray) -> np.ndarray:
        """Inverse of `moved`."""
        return unmove_pose(q, self.shift_uv, self.theta)


class Bench:
    """The object of a scene, to try grasps on.

    It stays in the middle of the world where it was settled, and poses are moved to it instead: the physics of a grasp
    does not depend on where on the table it happens.
    """

    def __init__(self, resting: Resting, rig: Rig, scene: Scene):
        self.grasper, self.scene = Grasper(resting, rig), scene

    def grasp(self, q: np.ndarray, film: bool = False) -> Result:
        """Attempt pose q (3,) of the image."""
        return self.grasper.run(self.scene.unmoved(q), film=film)
