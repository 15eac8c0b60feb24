"""Reading one trial from an MCAP file, written by the simulated robot or by any other that records ROS 2 messages.

A recording holds one trial: exactly one message on the topics of the commanded pose, the achieved pose and the
outcome; at least one depth image before the command (the last of them is the one planned on) and its CameraInfo;
joint states are read where there are any. Poses are in the frame `table` (`trial.FRAME`); their x axis is the
direction in which the jaws close, so a gripper frame whose z points down does as well. The metadata record
`graspfn.trial` (`trial.METADATA_KEYS`) says what was tried. Where the method found no grasp, it says so
(`trial.PLANNED`), and the recording has neither pose: its image is the last one before the outcome.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from mcap.reader import SeekingReader
from mcap.records import Channel, Message, Schema
from mcap_ros2.decoder import DecoderFactory

from graspfn.params import Topics
from graspfn.robot import decode
from graspfn.robot.trial import (
    METADATA,
    METADATA_KEYS,
    PLANNED,
    Condition,
    RecordingError,
    TrialRecording,
    was_planned,
)


@dataclass(frozen=True)
class Stamped:
    """A decoded message and when it was logged."""

    time_ns: int
    message: Any


MAGIC = b"\x89MCAP0\r\n"  # first and last bytes of a finished MCAP file


def _open(stream: IO[bytes]) -> SeekingReader:
    if stream.read(len(MAGIC)) != MAGIC:
        raise RecordingError("not an MCAP file")
    size = stream.seek(0, os.SEEK_END)
    stream.seek(max(0, size - len(MAGIC)))
    if size < 2 * len(MAGIC) or stream.read() != MAGIC:
        raise RecordingError("cut short: the recording was not finished, or not copied whole")
    stream.seek(0)
    # No record can be longer than the file: a damaged length must not allocate gigabytes.
    return SeekingReader(stream, validate_crcs=True, record_size_limit=size)


def _metadata(reader: SeekingReader) -> dict[str, str]:
    for record in reader.iter_metadata():
        if record.name == METADATA:
            return dict(record.metadata)
    needed = "; ".join(f"{key}: {meaning}" for key, meaning in METADATA_KEYS.items())
    raise RecordingError(f"no metadata record {METADATA!r}, which takes the keys {needed}")


def _decoded(item: tuple[Schema | None, Channel, Message], factory: DecoderFactory, kind: str) -> Stamped:
    """One message as its fields; `kind` is the type that its topic takes."""
    schema, channel, message = item
    name = schema.name if schema else "no type"
    if name != kind:
        raise RecordingError(f"topic {channel.topic} carries {name}; it takes {kind}")
    decoder = factory.decoder_for(channel.message_encoding, schema)
    if decoder is None:
        raise RecordingError(f"topic {channel.topic} is not encoded as ROS 2 messages (cdr, ros2msg)")
    return Stamped(message.log_time, decoder(message.data))


def messages_of_trial(reader: SeekingReader, topics: Topics, planned: bool = True) -> dict[str, list[Stamped]]:
    """The messages of each topic (keys as in `params.Topics`) in order of time; of camera topics only the last before
    the command, so that a recorded video does not fill the memory. planned: whether there was a grasp to command."""
    kinds = {
        "depth": "sensor_msgs/msg/Image",
        "camera_info": "sensor_msgs/msg/CameraInfo",
        "commanded": "geometry_msgs/msg/PoseStamped",
        "achieved": "geometry_msgs/msg/PoseStamped",
        "joints": "sensor_msgs/msg/JointState",
        "outcome": "std_msgs/msg/Bool",
    }
    last = "commanded" if planned else "outcome"
    key_of = {getattr(topics, key): key for key in kinds}
    found: dict[str, list[Any]] = {key: [] for key in kinds}
    for item in reader.iter_messages(topics=list(key_of)):
        key = key_of[item[1].topic]
        if key not in ("depth", "camera_info"):
            found[key].append(item)
        elif not found[last]:
            found[key] = [item]
    for key in ("commanded", "achieved", "outcome"):
        if planned or key == "outcome":
            if len(found[key]) != 1:
                raise RecordingError(f"{_count(found[key])} on topic {getattr(topics, key)}; a trial has exactly one")
        elif found[key]:
            raise RecordingError(f"{_count(found[key])} on topic {getattr(topics, key)}, but metadata {PLANNED}: false")
    for key in ("camera_info", "depth"):
        if not found[key]:
            before = "commanded pose" if planned else "outcome"
            raise RecordingError(f"no message on topic {getattr(topics, key)} before the {before}")
    factory = DecoderFactory()
    return {key: [_decoded(item, factory, kinds[key]) for item in items] for key, items in found.items()}


def _count(items: list[Any]) -> str:
    return "no message" if not items else "1 message" if len(items) == 1 else f"{len(items)} messages"


@contextmanager
def _naming(topic: str) -> Iterator[None]:
    """Errors say which topic the message came on."""
    try:
        yield
    except RecordingError as error:
        raise RecordingError(f"topic {topic}: {error}") from None


def _pose(found: list[Stamped], topic: str) -> np.ndarray | None:
    with _naming(topic):
        return decode.pose(found[0].message) if found else None


def _trial(reader: SeekingReader, topics: Topics) -> TrialRecording:
    metadata = _metadata(reader)
    condition, planned = Condition.from_metadata(metadata), was_planned(metadata)
    found = messages_of_trial(reader, topics, planned)
    start = found["commanded" if planned else "outcome"][0].time_ns
    names, time_s, positions = decode.joints([(item.time_ns, item.message) for item in found["joints"]], start)
    with _naming(topics.depth):
        depth = decode.depth(found["depth"][0].message)
    with _naming(topics.camera_info):
        info = found["camera_info"][0].message
        camera_matrix, distortion = decode.camera_matrix(info, depth.shape), decode.distortion(info)
    success = bool(found["outcome"][0].message.data)
    if success and not planned:
        raise RecordingError(f"topic {topics.outcome}: a success, but metadata {PLANNED}: false")
    return TrialRecording(
        condition=condition,
        depth=depth,
        camera_matrix=camera_matrix,
        commanded=_pose(found["commanded"], topics.commanded),
        achieved=_pose(found["achieved"], topics.achieved),
        joint_names=names,
        joint_time_s=time_s,
        joint_positions=positions,
        success=success,
        distortion=distortion,
    )


def read_trial(path: Path, topics: Topics) -> TrialRecording:
    """The trial in an MCAP file; RecordingError, in one line, where it is damaged or lacks something."""
    try:
        with path.open("rb") as stream:
            return _trial(_open(stream), topics)
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from None
    except Exception as error:
        # Damaged bytes surface as any of a dozen unrelated types from the mcap, cdr and compression libraries.
        detail = " ".join(f"{type(error).__name__} {error}".split())
        raise RecordingError(f"{path}: damaged: {detail}") from error


def recordings(folder: Path) -> list[Path]:
    """The .mcap files directly in a folder, by name."""
    found = sorted(folder.glob("*.mcap")) if folder.is_dir() else []
    if not found:
        raise RecordingError(f"{folder}: no .mcap files; robot.folder takes a directory of them")
    return found
