"""Reading one trial from a bag, recorded by the simulated robot or by any other that speaks ROS 2.

A bag holds one trial: the depth image that was planned on (the last before the command) and its CameraInfo, the
commanded pose, where the gripper was as its fingers began to close, and whether the object was held. docs/recordings.md
says where each may come from. Poses are in the frame `table` (`trial.FRAME`), or in one that TF connects with it. What
is odd is said in `TrialRecording.flags`; what keeps a reached pose from being a measurement, in `doubts`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from graspfn.imaging.camera import Camera
from graspfn.imaging.table import TableError, fit_table
from graspfn.params import Arm, Robot, Table, Topics
from graspfn.robot import decode, plausible
from graspfn.robot.bag import Bag, is_bag, open_bag, telling_damage
from graspfn.robot.closing import closing_s
from graspfn.robot.described import TABLE, description
from graspfn.robot.mcap_file import Raw
from graspfn.robot.messages import SCHEMAS
from graspfn.robot.target import DOWN, target_in_image
from graspfn.robot.tf import NEAR_S, Frames, clock_offset_ns, rigid, stamp_ns
from graspfn.robot.trial import (
    FRAME,
    PLANNED,
    Condition,
    RecordingError,
    TrialRecording,
    pose_of,
    was_planned,
)

KINDS = {
    "depth": ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"),
    "camera_info": ("sensor_msgs/msg/CameraInfo",),
    "commanded": ("geometry_msgs/msg/PoseStamped",),
    "achieved": ("geometry_msgs/msg/PoseStamped",),
    "joints": ("sensor_msgs/msg/JointState",),
    "outcome": ("std_msgs/msg/Bool",),
    "tf": ("tf2_msgs/msg/TFMessage",),
    "tf_static": ("tf2_msgs/msg/TFMessage",),
}
RECORDINGS = Path("data/recordings")  # of the simulated robot
LAZY = ("depth", "gripper")  # left in the file; of the gripper's commands only the times are of use
ARM = Arm("topic", FRAME, "up", "base_link", "gripper", "x", None, 1, None)  # whose poses are all in the frame `table`
THIN_NS = 5_000_000
# What a recorded image may be drawn over: any table that a camera from above sees.
ANY_TABLE = Table(fit=True, max_tilt_deg=20, min_inliers=0.05, max_rms_mm=20, max_offset_mm=1e4)


@contextmanager
def _naming(topic: str) -> Iterator[None]:
    """Errors say which topic the message came on."""
    try:
        yield
    except RecordingError as error:
        raise RecordingError(f"topic {topic}: {error}") from None


def _count(items: list[Any]) -> str:
    return "no message" if not items else "1 message" if len(items) == 1 else f"{len(items)} messages"


@dataclass
class _Trial:
    """What is found out of one bag, step by step. said: what the trial was."""

    bag: Bag
    topics: Topics
    arm: Arm
    said: Mapping[str, str]

    def __post_init__(self) -> None:
        self._factory = DecoderFactory()
        self._schemas: dict[Any, Schema] = {}
        self._frames: dict[int, Frames] = {}
        self.planned = was_planned(self.said)
        self.flags, self.doubts = list(self.bag.flags), list[str]()

    def raw(self, key: str) -> list[Raw]:
        topic = getattr(self.topics, key)
        return [] if topic is None else self.bag.found[topic]

    def decode(self, key: str, raw: Raw) -> Any:
        """A message as its fields."""
        topic, kinds = raw.topic, KINDS[key]
        if topic.kind not in kinds:
            raise RecordingError(f"topic {topic.name} carries {topic.kind}; it takes {' or '.join(kinds)}")
        if topic.encoding != "cdr":
            raise RecordingError(f"topic {topic.name} is encoded as {topic.encoding!r}; it takes cdr, as ROS 2 writes")
        # A bag of an old recorder, or with definitions in another language, has none of use: the type's name tells.
        text = topic.definition or SCHEMAS[topic.kind].encode()
        schema = self._schemas.setdefault(topic, Schema(len(self._schemas) + 1, text, "ros2msg", topic.kind))
        decoder = self._factory.decoder_for("cdr", schema)
        assert decoder is not None
        return decoder(self.bag.data(raw))

    def thinned(self, key: str) -> Iterator[Raw]:
        """Of each publisher on a topic no more than one message in THIN_NS: some publish every millisecond."""
        last: dict[Any, int] = {}
        for raw in self.raw(key):
            data = self.bag.data(raw)
            publisher = len(data), data[12:140]  # the names of its joints, after the stamp
            if raw.time_ns - last.get(publisher, -THIN_NS) >= THIN_NS:
                last[publisher] = raw.time_ns
                yield raw

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
        with _naming(self.topics.depth):
            depth = decode.depth(self.image)
            decode.check_distance(depth)
        return depth

    @cached_property
    def camera(self) -> Camera:
        with _naming(self.topics.camera_info):
            info = self.decode("camera_info", self.last_before_plan("camera_info"))
            height, width = self.depth.shape
            K = decode.camera_matrix(info, (height, width))
            return Camera(width, height, (K[0, 0], K[1, 1], K[0, 2], K[1, 2]), decode.distortion(info))

    @cached_property
    def joints(self) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
        """Names, times [s] since zero_ns by the recorder's clock, positions."""
        messages = [(raw.time_ns, self.decode("joints", raw)) for raw in self.thinned("joints")]
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
        with _naming(self.topics.joints):
            seconds = closing_s(*self.fingers, self.arm.finger_sign)
            if seconds is None:
                raise RecordingError(f"{', '.join(self.arm.finger_joints)} never closed")
        return self.zero_ns + round(seconds * 1e9)

    @property
    def tells_closing(self) -> bool:
        return bool(self.arm.finger_joints or self.topics.gripper)

    @cached_property
    def clock_offset_ns(self) -> int:
        return clock_offset_ns((raw.time_ns, self.decode("tf", raw)) for raw in self.raw("tf")[:20])

    def frames(self, stamp: int) -> Frames:
        """Around a moment [ns] of the transforms' clock."""
        if stamp not in self._frames:
            logged, near = stamp - self.clock_offset_ns, NEAR_S * 1e9
            moving = [raw for raw in self.raw("tf") if abs(raw.time_ns - logged) <= near]
            found = {"tf": moving, "tf_static": self.raw("tf_static")}
            self._frames[stamp] = Frames(
                *([(raw.time_ns, self.decode(key, raw)) for raw in raws] for key, raws in found.items())
            )
        return self._frames[stamp]

    def stamp(self, logged_ns: int) -> int:
        """A moment of the recorder's clock by that of the transforms."""
        return logged_ns + self.clock_offset_ns

    def T_table(self, frame: str, stamp: int) -> np.ndarray:
        """T_table_frame (4, 4) at a moment [ns] of the transforms' clock, the table's z up."""
        flip = DOWN if self.arm.table_z == "down" else np.eye(4)
        if frame == self.arm.table_frame:
            return flip
        if self.arm.table_frame is not None:
            return flip @ self.frames(stamp).lookup(self.arm.table_frame, frame, stamp)
        try:
            T_table_camera = fit_table(self.depth, self.camera, ANY_TABLE).T_world_camera
        except TableError as error:
            raise RecordingError(f"topic {self.topics.depth}: {error}") from None
        seen = stamp_ns(self.image.header) or self.stamp(self.last_before_plan("depth").time_ns)
        camera = self.image.header.frame_id.lstrip("/")
        T_camera_base = self.frames(seen).lookup(camera, self.arm.base_frame, seen)
        return T_table_camera @ T_camera_base @ self.frames(stamp).lookup(self.arm.base_frame, frame, stamp)

    def pose(self, logged_ns: int, stamped: Any) -> np.ndarray:
        """(3,) of a PoseStamped in whatever frame."""
        frame = stamped.header.frame_id.lstrip("/")
        stamp = stamp_ns(stamped.header) or self.stamp(logged_ns)
        if frame == FRAME and frame not in self.frames(stamp) and self.arm.table_frame in (FRAME, None):
            T_table_frame = DOWN if self.arm.table_z == "down" else np.eye(4)
        else:
            T_table_frame = self.T_table(frame, stamp)
        T_frame_pose = rigid(stamped.pose.position, stamped.pose.orientation)
        return target_in_image(T_table_frame @ T_frame_pose, self.arm.closing_axis)

    @cached_property
    def commanded(self) -> np.ndarray | None:
        if not self.planned:
            return None
        given = pose_of(self.said)
        if given is not None or self.commanded_message is None:
            return given
        with _naming(self.topics.commanded):
            return self.pose(*self.commanded_message)

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
            T = self.T_table(self.arm.gripper_frame, self.stamp(self.closing_ns))
            return target_in_image(T, self.arm.closing_axis)
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
        self.doubts += plausible.order(self.command_ns, chosen.time_ns, self.topics.achieved)
        with _naming(self.topics.achieved):
            return self.pose(chosen.time_ns, self.decode("achieved", chosen))

    def recording(self) -> TrialRecording:
        condition = Condition.from_metadata(self.said)
        command_ns = self.command_ns or 0
        success, depth, camera = self.success, self.depth, self.camera
        if self.raw("outcome") and self.raw("outcome")[-1].time_ns < command_ns:
            raise RecordingError(f"topic {self.topics.outcome}: the verdict comes before the commanded pose")
        commanded, achieved = self.commanded, self.achieved
        names, time_s, positions = self.joints
        if self.arm.finger_joints and success and self.arm.finger_shut is not None:
            plausible.check_fingers(self.fingers[1], self.arm)
        if commanded is not None and achieved is not None:
            self.doubts += plausible.reached(commanded, achieved, condition)
        self.doubts += self.bag.jumps
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
        )


def read_trial(path: Path, topics: Topics, arm: Arm = ARM, row: Mapping[str, str] | None = None) -> TrialRecording:
    """The trial in a bag; RecordingError, in one line, where it is damaged or lacks something.

    row: what trials.csv says of it, if there is one (`described.read_table`).
    """
    wanted = [topic for key in (*KINDS, "gripper") if (topic := getattr(topics, key))]
    try:
        with open_bag(path, wanted, [topic for key in LAZY if (topic := getattr(topics, key))]) as bag:
            try:
                with telling_damage():
                    return _Trial(bag, topics, arm, description(path, bag.metadata, row or {})).recording()
            except RecordingError as error:
                raise RecordingError("; ".join([str(error), *bag.flags])) from None
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from None


def recordings(folder: Path) -> list[Path]:
    """The bags directly in a folder, by name."""
    found = sorted(child for child in folder.iterdir() if is_bag(child)) if folder.is_dir() else []
    if not found:
        raise RecordingError(f"{folder}: no .mcap files; robot.folder takes a directory of bags, {TABLE} beside them")
    return found


def source_of(robot: Robot, arm: Arm) -> tuple[Path, Arm]:
    """Where the bags lie, those of the user where they are, and how they tell where the gripper was."""
    return (Path(robot.folder), arm) if robot.source == "folder" else (RECORDINGS, ARM)
