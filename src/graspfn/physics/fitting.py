"""How large an object may be to fit between the open fingers and under the palm.

The paper scaled its objects "to within a range of appropriate dimensions for graspable objects" (IV-C). Appropriate to
what is the gripper in use: an object fits if, at some angle, it stands between the inner faces of the open fingers with
some room to spare, and under the palm. Both are linear in its size, so the largest size that fits has a closed form.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from graspfn.geometry.transforms import apply
from graspfn.meshes.placed import Resting
from graspfn.physics.gripper import Kinematics

ANGLES = np.radians(np.arange(180))  # at which the hand is held over the object


def largest_scale(resting: Resting, kinematics: Kinematics, room_m: float) -> float:
    """The factor by which a resting object may be scaled, about the point of the table below it, and just fit.

    room_m: how much narrower than the gap between the fingers it has to be, metres. At least 1: it fits as it is.
    """
    points = apply(resting.T_world_object, resting.mesh.vertices)
    points = points[ConvexHull(points).vertices]
    gap, taper = kinematics.gap()
    across = points[:, :1] * np.cos(ANGLES) + points[:, 1:2] * np.sin(ANGLES)  # (n, angles)
    # Inner faces lean: a point at height z needs as much more of the gap as they close in on it by that height.
    lean = taper * points[:, 2:]
    needed = (across + lean).max(axis=0) + (lean - across).max(axis=0)
    return float(min((gap - room_m) / needed.min(), kinematics.height / points[:, 2].max()))
