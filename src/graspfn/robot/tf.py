"""Where frames were: /tf and /tf_static of a bag, looked up at a moment.

TF holds what the encoders say through the model of the arm, and a calibration that somebody made: an error of the
calibration is in no transform. Only a measurement from outside shows it.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from graspfn.robot.trial import RecordingError

LATE_S = 0.1  # before the first or after the last transform of a frame it is taken to be where it is then
NEAR_S = (
    0.6  # that frames are read before and after the moment that they are asked for: /tf may have thousands a second
)
GAP_S = 0.5  # between two transforms; over a longer gap nothing is interpolated


def rigid(translation: Any, rotation: Any) -> np.ndarray:
    """(4, 4) of a geometry_msgs translation or position and quaternion; RecordingError where they are none."""
    quaternion = np.array([rotation.x, rotation.y, rotation.z, rotation.w], dtype=float)
    position = np.array([translation.x, translation.y, translation.z], dtype=float)
    if not 0.9 < np.linalg.norm(quaternion) < 1.1:  # nor NaN
        raise RecordingError("pose whose orientation is not a unit quaternion")
    if not np.isfinite(position).all():
        raise RecordingError("pose whose position is not finite")
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_quat(quaternion).as_matrix(), position
    return T


@dataclass
class _Track:
    """T_parent_child over time; of a static one a single transform."""

    parent: str
    static: bool
    conflict: str = ""  # told to who asks for the frame: others are no business of theirs
    times: list[int] = field(default_factory=list)
    transforms: list[Any] = field(default_factory=list)  # messages, which few of are ever looked at


class Frames:
    """The tree of frames around one moment of a bag."""

    def __init__(self, moving: Iterable[tuple[int, Any]], static: Iterable[tuple[int, Any]]):
        """moving, static: (when logged [ns], tf2_msgs/TFMessage); of moving ones those of NEAR_S before and after."""
        self._tracks: dict[str, _Track] = {}
        for messages, fixed in ((static, True), (moving, False)):
            for logged, message in messages:
                for transform in message.transforms:
                    self._add(logged, transform, fixed)
        for track in self._tracks.values():
            order = np.argsort(track.times, kind="stable")
            track.times = [track.times[i] for i in order]
            track.transforms = [track.transforms[i] for i in order]

    def _add(self, logged: int, transform: Any, static: bool) -> None:
        parent, child = transform.header.frame_id.lstrip("/"), transform.child_frame_id.lstrip("/")
        track = self._tracks.setdefault(child, _Track(parent, static))
        if track.parent != parent:
            track.conflict = f"frame {child!r} hangs from both {track.parent!r} and {parent!r}"
        if track.static != static:
            track.conflict = f"frame {child!r} is both in topics.tf and in topics.tf_static"
        if static:
            track.times, track.transforms = [0], [transform.transform]
            return
        track.times.append(stamp_ns(transform.header) or logged)
        track.transforms.append(transform.transform)

    def __contains__(self, frame: str) -> bool:
        return frame in self._tracks or any(track.parent == frame for track in self._tracks.values())

    def lookup(self, target: str, source: str, time_ns: int) -> np.ndarray:
        """T_target_source (4, 4) at a time [ns]; RecordingError where TF does not say."""
        for frame in (target, source):
            if frame not in self:
                known = sorted({name for child, track in self._tracks.items() for name in (child, track.parent)})
                where = f"within {NEAR_S} s of the moment asked for; there are {', '.join(known) or 'none'}"
                raise RecordingError(f"no frame {frame!r} in TF {where}")
        up_target, up_source = self._ancestors(target), self._ancestors(source)
        common = next((frame for frame in up_source if frame in up_target), None)
        if common is None:
            raise RecordingError(f"TF does not connect {target!r} with {source!r}")
        T_common_target = self._down(up_target[: up_target.index(common)], time_ns)
        T_common_source = self._down(up_source[: up_source.index(common)], time_ns)
        return np.linalg.inv(T_common_target) @ T_common_source

    def _ancestors(self, frame: str) -> list[str]:
        line = [frame]
        while track := self._tracks.get(line[-1]):
            if track.conflict:
                raise RecordingError(track.conflict)
            line.append(track.parent)
            if line[-1] in line[:-1]:
                raise RecordingError(f"TF runs in a circle at frame {line[-1]!r}")
        return line

    def _down(self, line: list[str], time_ns: int) -> np.ndarray:
        T = np.eye(4)
        for frame in line:
            T = self._at(frame, time_ns) @ T
        return T

    def _at(self, frame: str, time_ns: int) -> np.ndarray:
        """T_parent_frame at a time."""
        track = self._tracks[frame]
        i = bisect_left(track.times, time_ns)
        if track.static or (i < len(track.times) and track.times[i] == time_ns):
            chosen = track.transforms[0 if track.static else i]
            return rigid(chosen.translation, chosen.rotation)
        if i in (0, len(track.times)):
            nearest = min(i, len(track.times) - 1)
            away = abs(track.times[nearest] - time_ns) * 1e-9
            if away > LATE_S:
                raise RecordingError(
                    f"TF of {frame!r} {'ends' if i else 'begins'} {away:.1f} s from the moment asked for"
                )
            return rigid(track.transforms[nearest].translation, track.transforms[nearest].rotation)
        before, after = track.times[i - 1], track.times[i]
        if (after - before) * 1e-9 > GAP_S:
            raise RecordingError(
                f"TF of {frame!r} has a gap of {(after - before) * 1e-9:.1f} s at the moment asked for"
            )
        ends = [rigid(track.transforms[j].translation, track.transforms[j].rotation) for j in (i - 1, i)]
        share = (time_ns - before) / (after - before)
        T = np.eye(4)
        T[:3, 3] = (1 - share) * ends[0][:3, 3] + share * ends[1][:3, 3]
        T[:3, :3] = Slerp([0, 1], Rotation.from_matrix([end[:3, :3] for end in ends]))(share).as_matrix()
        return T


def stamp_ns(header: Any) -> int:
    """Of a std_msgs/Header; 0 where it is unset."""
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)


def clock_offset_ns(moving: Iterable[tuple[int, Any]]) -> int:
    """Stamps of transforms less when they were logged: the arm's clock may not be the recorder's."""
    offsets = [
        stamp_ns(transform.header) - logged
        for logged, message in moving
        for transform in message.transforms
        if stamp_ns(transform.header)
    ]
    return int(np.median(offsets)) if offsets else 0
