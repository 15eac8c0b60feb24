"""Whether a trial held, judged from the fingers and the lift beside the operator's verdict."""

from __future__ import annotations

import numpy as np

from graspfn.params import Arm

LIFTED_M = 0.05  # that the gripper rises, at least, from where its fingers begin to close until the verdict
SHUT = 0.02  # share of the fingers' way within which they count as shut
SHUT_WORDS = "fingers shut on nothing"
OPEN = 0.05  # and within which they count as open


def judge(fingers: np.ndarray, arm: Arm, lift_m: float | None) -> tuple[bool | None, str]:
    """Whether the gripper holds something up, and why not; None where its recording does not tell.

    fingers: (T, fingers) from the command to the verdict, NaN where a message did not name one. lift_m: how far the
    gripper rose; None where nothing says.
    """
    if lift_m is not None and lift_m < LIFTED_M:
        return False, f"the gripper rose by {lift_m * 1000:.0f} mm alone"
    told = fingers[np.isfinite(fingers).all(axis=1)] if fingers.size else fingers[:0]
    if not len(told) or arm.finger_shut is None:
        return None, ""
    mean, shut = arm.finger_sign * told.mean(axis=1), arm.finger_sign * arm.finger_shut
    way = shut - mean.min()
    if mean[-1] >= shut - SHUT * way:
        return False, SHUT_WORDS
    if mean[-1] <= mean.min() + OPEN * way:
        return False, "fingers stand open"
    return (None, "") if lift_m is None else (True, "")
