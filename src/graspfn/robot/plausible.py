"""Values of a recording that cannot be: each is said in a line, and measures nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from graspfn.geometry.grid import angle_difference
from graspfn.params import Arm
from graspfn.robot.judged import SHUT_WORDS, judge
from graspfn.robot.tf import stamp_ns
from graspfn.robot.trial import Condition, RecordingError

FAR_M = 0.3  # from the commanded pose no arm ends that executes it
TURNED_DEG, WIDE_DEG = 60.0, 20.0  # where no such spread was injected, so large an angle is another axis
JUMP_S = 1.0  # of one clock against another


def reached(commanded: np.ndarray, achieved: np.ndarray, condition: Condition) -> list[str]:
    """What is wrong with where the gripper was; poses: (3,)."""
    found = []
    away = float(np.hypot(*(achieved - commanded)[:2]))
    if away > FAR_M:
        found.append(f"reached {away:.3g} m from the commanded position")
    turned = float(np.degrees(abs(angle_difference(achieved[2], commanded[2]))))
    if turned > TURNED_DEG and (condition.injected_theta_deg or 0) < WIDE_DEG:
        found.append(f"turned by {turned:.0f}° from the commanded angle: arm.closing_axis names another axis?")
    if np.array_equal(achieved, commanded) and not condition.simulated:
        found.append("reached the commanded pose to the last bit: the command, not a measurement")
    return found


def order(commanded_ns: int | None, reached_ns: int, verdict_ns: int | None, topic: str) -> list[str]:
    """What is wrong with when the pose reached was logged; None: nothing says when that was."""
    if commanded_ns is not None and reached_ns < commanded_ns:
        return [f"topic {topic}: the pose reached comes {(commanded_ns - reached_ns) * 1e-9:.3g} s before the command"]
    if verdict_ns is not None and reached_ns > verdict_ns:
        return [f"topic {topic}: the pose reached comes {(reached_ns - verdict_ns) * 1e-9:.3g} s after the verdict"]
    return []


def clock_jumps(messages: Sequence[tuple[int, Any]], topic: str) -> list[str]:
    """messages: (when logged [ns], with a header)."""
    offsets = [stamp_ns(message.header) - logged for logged, message in messages if stamp_ns(message.header)]
    jump = (max(offsets) - min(offsets)) * 1e-9 if offsets else 0.0
    return [f"topic {topic}: a clock jumps by {jump:.3g} s within the trial"] if jump > JUMP_S else []


def check_fingers(positions: np.ndarray, arm: Arm) -> None:
    """RecordingError where fingers (T, fingers) are shut on nothing at the end of a trial that is said to have held."""
    if judge(positions, arm, None)[1] == SHUT_WORDS:
        raise RecordingError("the verdict is held, but the fingers are shut on nothing (arm.finger_shut)")
