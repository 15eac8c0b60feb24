"""Where on the table things were: poses of whatever frame, taken there by TF."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from graspfn.imaging.camera import Camera
from graspfn.imaging.table import TableError, fit_table
from graspfn.params import Arm, Table
from graspfn.robot.mcap_file import Raw
from graspfn.robot.target import DOWN, target_in_image
from graspfn.robot.tf import NEAR_S, Frames, clock_offset_ns, rigid, stamp_ns
from graspfn.robot.topics import Messages
from graspfn.robot.trial import FRAME, RecordingError, TrialRecording

# What a recorded image may be drawn over: any table that a camera from above sees.
ANY_TABLE = Table(fit=True, max_tilt_deg=20, min_inliers=0.05, max_rms_mm=20, max_offset_mm=1e4)


def camera_of(trial: TrialRecording) -> Camera:
    """The camera of a recording, which does not say how high it stood: over the table that it sees."""
    height, width = trial.depth.shape
    K = trial.camera_matrix
    camera = Camera(width, height, (K[0, 0], K[1, 1], K[0, 2], K[1, 2]), trial.distortion)
    try:
        return camera.at(fit_table(trial.depth, camera, ANY_TABLE).T_world_camera)
    except TableError:
        return Camera.of_the_paper(width, height, float(K[0, 0]))


@dataclass(frozen=True, eq=False)
class View:
    """The image that was planned on. header: a std_msgs/Header; logged_ns: by the recorder's clock."""

    header: Any
    logged_ns: int
    depth: np.ndarray
    camera: Camera


class Places:
    """Of one bag. view: is asked for only where the table has no frame."""

    def __init__(self, messages: Messages, arm: Arm, view: Callable[[], View]):
        self._messages, self._arm, self._view = messages, arm, view
        self._frames: dict[int, Frames] = {}
        self._decoded: dict[int, Any] = {}  # of transforms, by the identity of their bytes: moments share most

    @cached_property
    def clock_offset_ns(self) -> int:
        return clock_offset_ns((raw.time_ns, self._messages.decode("tf", raw)) for raw in self._messages.raw("tf")[:20])

    def frames(self, stamp: int) -> Frames:
        """Around a moment [ns] of the transforms' clock."""
        if stamp not in self._frames:
            logged, near = stamp - self.clock_offset_ns, NEAR_S * 1e9
            moving = [raw for raw in self._messages.raw("tf") if abs(raw.time_ns - logged) <= near]
            found = {"tf": moving, "tf_static": self._messages.raw("tf_static")}
            self._frames[stamp] = Frames(
                *([(raw.time_ns, self._transforms(key, raw)) for raw in raws] for key, raws in found.items())
            )
        return self._frames[stamp]

    def _transforms(self, key: str, raw: Raw) -> Any:
        if id(raw) not in self._decoded:
            self._decoded[id(raw)] = self._messages.decode(key, raw)
        return self._decoded[id(raw)]

    def stamp(self, logged_ns: int) -> int:
        """A moment of the recorder's clock by that of the transforms."""
        return logged_ns + self.clock_offset_ns

    def T_table(self, frame: str, stamp: int) -> np.ndarray:
        """T_table_frame (4, 4) at a moment [ns] of the transforms' clock, the table's z up."""
        flip = DOWN if self._arm.table_z == "down" else np.eye(4)
        if frame == self._arm.table_frame:
            return flip
        if self._arm.table_frame is not None:
            return flip @ self.frames(stamp).lookup(self._arm.table_frame, frame, stamp)
        view = self._view()
        try:
            T_table_camera = fit_table(view.depth, view.camera, ANY_TABLE).T_world_camera
        except TableError as error:
            raise RecordingError(f"topic {self._messages.topics.depth}: {error}") from None
        seen = stamp_ns(view.header) or self.stamp(view.logged_ns)
        camera = view.header.frame_id.lstrip("/")
        T_camera_base = self.frames(seen).lookup(camera, self._arm.base_frame, seen)
        return T_table_camera @ T_camera_base @ self.frames(stamp).lookup(self._arm.base_frame, frame, stamp)

    def gripper(self, logged_ns: int) -> np.ndarray:
        """(3,) where it was at a moment."""
        T_table_gripper = self.T_table(self._arm.gripper_frame, self.stamp(logged_ns))
        return target_in_image(T_table_gripper, self._arm.closing_axis)

    def pose(self, logged_ns: int, stamped: Any) -> np.ndarray:
        """(3,) of a PoseStamped in whatever frame."""
        frame = stamped.header.frame_id.lstrip("/")
        if frame == FRAME and self._arm.table_frame is None:
            T_table_frame = DOWN if self._arm.table_z == "down" else np.eye(4)
        elif frame == self._arm.table_frame:
            T_table_frame = self.T_table(frame, 0)  # in whose place no time matters
        else:
            T_table_frame = self.T_table(frame, stamp_ns(stamped.header) or self.stamp(logged_ns))
        T_frame_pose = rigid(stamped.pose.position, stamped.pose.orientation)
        return target_in_image(T_table_frame @ T_frame_pose, self._arm.closing_axis)
