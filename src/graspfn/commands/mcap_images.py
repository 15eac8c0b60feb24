"""The depth image on a topic of an .mcap recording, with the CameraInfo that ROS drivers publish beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import McapReader, make_reader
from mcap_ros2.decoder import DecoderFactory

from graspfn.commands.camera_files import lens
from graspfn.commands.ending import InputError
from graspfn.imaging.camera import Camera
from graspfn.robot import decode
from graspfn.robot.trial import RecordingError

IMAGE, CAMERA_INFO = "sensor_msgs/msg/Image", "camera_info"


def read_topic(path: Path, topic: str | None) -> tuple[np.ndarray, Camera | None]:
    """The last image on a topic, None for the only one that has depths, and its camera, if that is in the recording.

    The camera's topic is named as drivers name it: camera_info beside the image.
    """
    try:
        with path.open("rb") as stream:
            image, info, topic = _last(stream, path, topic)
    except (InputError, OSError):
        raise
    except Exception as error:  # damaged bytes surface as any of a dozen types
        raise InputError(f"{path}: damaged: {' '.join(f'{type(error).__name__} {error}'.split())}") from None
    try:
        depth = decode.depth(image)
        return depth, None if info is None else lens(info, depth.shape)
    except RecordingError as error:
        raise InputError(f"{path}: topic {topic}: {error}") from None


def _last(stream: Any, path: Path, topic: str | None) -> tuple[Any, Any, str]:
    reader = make_reader(stream, decoder_factories=[DecoderFactory()])
    summary = reader.get_summary()
    if summary is None:
        raise InputError(f"{path}: cut short: the recording was not finished, or not copied whole")
    kinds = {c.topic: s.name for c in summary.channels.values() if (s := summary.schemas.get(c.schema_id))}
    images = sorted(name for name, kind in kinds.items() if kind == IMAGE)
    if topic is None:
        decoded = {name: message for name in images if (message := _newest(reader, name))}
        images = [name for name, message in decoded.items() if message.encoding in decode.PIXELS]
        if len(images) != 1:
            raise InputError(f"{path}: has {len(images)} topics of depth images; --topic takes one of {sorted(kinds)}")
        topic = images[0]
    if kinds.get(topic) != IMAGE:
        raise InputError(f"--topic {topic}: {path} has no {IMAGE} on it; it takes one of {images}")
    image = _newest(reader, topic)
    if image is None:
        raise InputError(f"--topic {topic}: {path} has no message on it")
    return image, _newest(reader, f"{topic.rpartition('/')[0]}/{CAMERA_INFO}"), topic


def _newest(reader: McapReader, topic: str) -> Any:
    """The decoded message, None where there is none."""
    found = next(iter(reader.iter_decoded_messages(topics=[topic], reverse=True)), None)
    return None if found is None else found[3]
