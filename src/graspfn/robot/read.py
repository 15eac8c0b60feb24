"""Reading one trial from a bag, recorded by the simulated robot or by any other that speaks ROS 2.

A bag holds one trial: the depth image that was planned on (the last before the command) and its CameraInfo, the
commanded pose, where the gripper was as its fingers began to close, and whether the object was held. docs/recordings.md
says where each may come from. Poses are in the frame `table` (`trial.FRAME`), or in one that TF connects with it. What
is odd is said in `TrialRecording.flags`; what keeps a reached pose from being a measurement, in `doubts`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from graspfn.imaging.camera import Camera
from graspfn.params import Arm, Topics
from graspfn.robot import decode, plausible
from graspfn.robot.bag import is_bag, open_bag, telling_damage
from graspfn.robot.closing import closing_s
from graspfn.robot.described import TABLE, description
from graspfn.robot.judged import judge
from graspfn.robot.mcap_file import Raw
from graspfn.robot.places import Places, View
from graspfn.robot.topics import Messages, lazy, naming, wanted
from graspfn.robot.trial import (
    FRAME,
    PLANNED,
    Condition,
    RecordingError,
    TrialRecording,
    pose_of,
    was_planned,
)

LIFT_SAMPLES = 60
ARM = Arm("topic", FRAME, "up", "base_link", "gripper", "x", None, 1, None)  # whose poses are all in the frame `table`


class NeverClosed(RecordingError):
    """The fingers did not: there is no moment at which they began to."""


def _count(items: list[Any]) -> str:
    return "no message" if not items else "1 message" if len(items) == 1 else f"{len(items)} messages"


@dataclass
class _Trial:
    """What is found out of one bag, step by step. said: what the trial was."""

    messages: Messages
    arm: Arm
    said: Mapping[str, str]

    def __post_init__(self) -> None:
        bag = self.messages.bag
        self.topics, self.raw, self.decode = self.messages.topics, self.messages.raw, self.messages.decode
        self.planned = was_planned(self.said)
        self.flags, self.doubts = list(bag.flags), list(bag.jumps)

    @cached_property
    def commanded_message(self) -> Any:
        """With when it was logged; None where columns have the pose, or there was none to command."""
        found = self.raw("commanded")
        if not self.planned and found:
            raise RecordingError(f"{_count(found)} on topic {self.topics.commanded}, but {PLANNED}: false")
        if not self.planned or (not found and pose_of(self.said) is not None):
            return None
        if len(found) != 1:
            raise RecordingError(f"{_count(found)} on topic {self.topics.commanded}; a trial has exactly one")
        return found[0].time_ns, self.decode("commanded", found[0])

    @cached_property
    def command_ns(self) -> int | None:
        """When the pose was commanded; None where nothing says."""
        return int(self.commanded_message[0]) if self.commanded_message else None

    @cached_property
    def planned_ns(self) -> tuple[float, str]:
        """Before when the image was taken that was planned on, and what happened then."""
        if self.command_ns is not None:
            return self.command_ns, "the commanded pose"
        if self.planned and self.tells_closing:
            return self.closing_ns, "the fingers close"
        if self.raw("outcome"):
            return self.raw("outcome")[0].time_ns, "the outcome"
        return math.inf, "the end"

    @cached_property
    def success(self) -> bool:
        verdict, found = self.said.get("verdict"), self.raw("outcome")
        if verdict is None and not found:
            raise RecordingError(f"no message on topic {self.topics.outcome}, and no verdict in what the trial was")
        pressed = [bool(self.decode("outcome", raw).data) for raw in found]
        if len(set(pressed)) > 1:
            self.flags.append(f"the verdict changed {len(pressed) - 1} times; the last counts")
        success = pressed[-1] if verdict is None else verdict == "held"
        if success and not self.planned:
            raise RecordingError(f"topic {self.topics.outcome}: a success, but {PLANNED}: false")
        return success

    def last_before_plan(self, key: str) -> Raw:
        before, what = self.planned_ns
        found = [raw for raw in self.raw(key) if raw.time_ns <= before]
        if not found:
            raise RecordingError(f"no message on topic {getattr(self.topics, key)} before {what}")
        return found[-1]

    @cached_property
    def image(self) -> Any:
        return self.decode("depth", self.last_before_plan("depth"))

    @cached_property
    def depth(self) -> np.ndarray:
        with naming(self.topics.depth):
            depth = decode.depth(self.image)
            decode.check_distance(depth)
        return depth

    @cached_property
    def camera(self) -> Camera:
        with naming(self.topics.camera_info):
            info = self.decode("camera_info", self.last_before_plan("camera_info"))
            height, width = self.depth.shape
            return decode.camera(info, (height, width))

    @property
    def places(self) -> Places:
        """Not kept: it would hold the trial, and the trial it, and the memory both."""
        return Places(self.messages, self.arm, self.view)

    def view(self) -> View:
        return View(self.image.header, self.last_before_plan("depth").time_ns, self.depth, self.camera)

    @cached_property
    def joints(self) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
        """Names, times [s] since zero_ns by the recorder's clock, positions."""
        messages = [(raw.time_ns, self.decode("joints", raw)) for raw in self.messages.thinned("joints")]
        self.doubts += plausible.clock_jumps(messages, self.topics.joints)
        return decode.joints(messages, self.zero_ns)

    @cached_property
    def zero_ns(self) -> int:
        """From when the joints' times count: the command, else the outcome, else their first message."""
        if self.command_ns is not None:
            return self.command_ns
        return next((raw.time_ns for key in ("outcome", "joints") for raw in self.raw(key)), 0)

    @cached_property
    def fingers(self) -> tuple[np.ndarray, np.ndarray]:
        """Times [s] since zero_ns and positions (T, fingers) from the command to the verdict."""
        names, time_s, positions = self.joints
        missing = [name for name in self.arm.finger_joints or () if name not in names]
        if missing:
            raise RecordingError(
                f"topic {self.topics.joints}: no joint {', '.join(missing)}; there are {', '.join(names)}"
            )
        columns = [names.index(name) for name in self.arm.finger_joints or ()]
        outcomes = self.raw("outcome")
        end = (outcomes[-1].time_ns - self.zero_ns) * 1e-9 if outcomes else np.inf
        during = (time_s >= (-np.inf if self.command_ns is None else 0)) & (time_s <= end)
        return time_s[during], positions[during][:, columns]

    @cached_property
    def closing_ns(self) -> int:
        """When the fingers begin to close, by the recorder's clock."""
        if self.topics.gripper:
            found = [raw for raw in self.raw("gripper") if raw.time_ns >= (self.command_ns or 0)]
            if not found:
                raise RecordingError(f"no message on topic {self.topics.gripper} after the commanded pose")
            return found[0].time_ns
        if not self.arm.finger_joints:
            raise RecordingError("nothing tells when the fingers close; arm.finger_joints or topics.gripper does")
        fingers = self.fingers
        with naming(self.topics.joints):
            seconds = closing_s(*fingers, self.arm.finger_sign)
        if seconds is None:
            raise NeverClosed(f"topic {self.topics.joints}: {', '.join(self.arm.finger_joints)} never closed")
        return self.zero_ns + round(seconds * 1e9)

    @property
    def tells_closing(self) -> bool:
        return bool(self.arm.finger_joints or self.topics.gripper)

    @cached_property
    def commanded(self) -> np.ndarray | None:
        if not self.planned:
            return None
        given = pose_of(self.said)
        if given is not None or self.commanded_message is None:
            return given
        with naming(self.topics.commanded):
            return self.places.pose(*self.commanded_message)

    @cached_property
    def achieved(self) -> np.ndarray | None:
        """Where the gripper was as its fingers began to close."""
        if not self.planned:
            if found := self.raw("achieved"):
                raise RecordingError(f"{_count(found)} on topic {self.topics.achieved}, but {PLANNED}: false")
            return None
        if self.arm.achieved == "columns":
            reached = pose_of(self.said, "reached_")
            if reached is None:
                raise RecordingError("what the trial was lacks reached_u_mm, reached_v_mm, reached_theta_deg")
            return reached
        if self.arm.achieved == "tf":
            try:
                return self.places.gripper(self.closing_ns)
            except NeverClosed as error:
                if self.success:
                    raise
                self.doubts.append(str(error))  # the arm was stopped on its way: a failure, and no pose to measure
                return None
        found = self.raw("achieved")
        if not found:
            raise RecordingError(f"no message on topic {self.topics.achieved}")
        chosen = found[0]
        if len(found) > 1:  # a tracker's: the last before the fingers close
            if not self.tells_closing:
                raise RecordingError(
                    f"{_count(found)} on topic {self.topics.achieved}; a trial has exactly one, or arm.finger_joints "
                    "or topics.gripper to tell which was as the fingers closed"
                )
            earlier = [raw for raw in found if raw.time_ns <= self.closing_ns]
            if not earlier:
                raise RecordingError(f"no message on topic {self.topics.achieved} before the fingers close")
            chosen = earlier[-1]
        verdict_ns = self.raw("outcome")[-1].time_ns if self.raw("outcome") else None
        self.doubts += plausible.order(self.command_ns, chosen.time_ns, verdict_ns, self.topics.achieved)
        with naming(self.topics.achieved):
            return self.places.pose(chosen.time_ns, self.decode("achieved", chosen))

    def heights(self, moments_ns: Sequence[int]) -> np.ndarray:
        """Of the gripper above the table at moments of the recorder's clock, metres; NaN where TF does not say."""
        places, found = self.places, []
        for moment in moments_ns:
            try:
                found.append(float(places.T_table(self.arm.gripper_frame, places.stamp(moment))[2, 3]))
            except RecordingError:
                found.append(math.nan)
        return np.array(found)

    def judged(self, success: bool) -> tuple[bool | None, str]:
        """Whether fingers and lift say that it held, None where they do not tell, and why not; a disagreement with the
        verdict is flagged."""
        outcomes = self.raw("outcome")
        if not self.planned:
            return None, "no grasp was found to try"
        if not (outcomes and self.arm.finger_joints) or np.isfinite(self.fingers[1]).all(axis=1).sum() < 2:
            return None, ""
        judged, why = self._judged_at(outcomes[-1].time_ns)
        if judged is not None and judged != success:
            seen = "the fingers hold something up" if judged else why
            self.flags.append(f"the verdict is {'held' if success else 'failed'}, but {seen}")
        return judged, why

    def _judged_at(self, verdict_ns: int) -> tuple[bool | None, str]:
        lift = math.nan
        try:
            closing_ns = self.closing_ns
            if self.raw("tf"):
                low, high = self.heights([closing_ns, verdict_ns])
                lift = float(high - low)
        except NeverClosed:
            return False, "the fingers never closed"
        except RecordingError:
            pass  # nothing tells when they closed
        return judge(self.fingers[1], self.arm, None if math.isnan(lift) else lift)

    def lift(self) -> tuple[np.ndarray, np.ndarray]:
        """Times [s] since the command and heights [m] of the gripper, as far as TF has them."""
        outcomes = self.raw("outcome")
        if not (self.raw("tf") and outcomes and self.command_ns is not None):
            return np.zeros(0), np.zeros(0)
        time_s = np.linspace(0, (outcomes[-1].time_ns - self.command_ns) * 1e-9, LIFT_SAMPLES)
        heights = self.heights([self.command_ns + round(s * 1e9) for s in time_s.tolist()])
        known = np.isfinite(heights)
        return time_s[known], heights[known]

    def recording(self, detail: bool = False) -> TrialRecording:
        condition = Condition.from_metadata(self.said)
        command_ns = self.command_ns or 0
        success, depth, camera = self.success, self.depth, self.camera
        if self.raw("outcome") and self.raw("outcome")[-1].time_ns < command_ns:
            raise RecordingError(f"topic {self.topics.outcome}: the verdict comes before the commanded pose")
        commanded, achieved = self.commanded, self.achieved
        names, time_s, positions = self.joints
        # That of a simulated robot is no press of a button: it may hold what is as thin as a sheet of paper.
        if self.arm.finger_joints and success and self.arm.finger_shut is not None and not condition.simulated:
            plausible.check_fingers(self.fingers[1], self.arm)
        if commanded is not None and achieved is not None:
            self.doubts += plausible.reached(commanded, achieved, condition)
        judged, why = self.judged(success)
        lift_time_s, lift_m = self.lift() if detail else (np.zeros(0), np.zeros(0))
        return TrialRecording(
            condition=condition,
            depth=depth,
            camera_matrix=camera.matrix,
            commanded=commanded,
            achieved=achieved,
            joint_names=names,
            joint_time_s=time_s,
            joint_positions=positions,
            success=success,
            distortion=camera.distortion,
            flags=tuple(self.flags),
            doubts=tuple(dict.fromkeys(self.doubts)),
            judged=judged,
            why=why,
            lift_time_s=lift_time_s,
            lift_m=lift_m,
        )


def read_trial(
    path: Path, topics: Topics, arm: Arm = ARM, row: Mapping[str, str] | None = None, detail: bool = False
) -> TrialRecording:
    """The trial in a bag; RecordingError, in one line, where it is damaged or lacks something.

    row: what trials.csv says of it, if there is one (`described.read_table`). detail: the lift over time as well.
    """
    try:
        with open_bag(path, wanted(topics), lazy(topics)) as bag:
            try:
                with telling_damage():
                    return _Trial(Messages(bag, topics), arm, description(path, bag.metadata, row or {})).recording(
                        detail
                    )
            except RecordingError as error:
                raise RecordingError("; ".join([str(error), *bag.flags])) from None
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from None


def _bags(folder: Path) -> Iterator[Path]:
    for child in folder.iterdir():
        if is_bag(child):
            yield child
        elif child.is_dir() and not child.is_symlink() and not child.name.startswith("."):
            yield from _bags(child)


def recordings(folder: Path) -> list[Path]:
    """The bags in a folder and the folders in it, by name."""
    found = sorted(_bags(folder)) if folder.is_dir() else []
    if not found:
        raise RecordingError(f"{folder}: no .mcap files; robot.folder takes a directory of bags, {TABLE} beside them")
    return found
