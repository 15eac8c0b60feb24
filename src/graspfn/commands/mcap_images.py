"""The depth image on a topic of an .mcap recording, with the CameraInfo that ROS drivers publish beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from graspfn.commands.ending import InputError
from graspfn.imaging.camera import Camera
from graspfn.robot import decode
from graspfn.robot.bag import Bag, open_bag, telling_damage
from graspfn.robot.mcap_file import CUT
from graspfn.robot.topics import KINDS, Decoder, naming
from graspfn.robot.trial import RecordingError

CAMERA_INFO = "camera_info"


def read_topic(path: Path, topic: str | None) -> tuple[np.ndarray, Camera | None]:
    """The last image on a topic, None for the only one that has depths, and its camera, if that is in the recording.

    The camera's topic is named as drivers name it: camera_info beside the image.
    """
    try:
        with open_bag(path, (), ()) as bag:
            kinds = bag.kinds
        if cut := [flag for flag in bag.flags if flag.startswith(CUT)]:
            raise InputError(f"{path}: {cut[0]}: the recording was not finished, or not copied whole")
        images = sorted(name for name, kind in kinds.items() if kind in KINDS["depth"])
        if topic is not None and topic not in images:
            raise InputError(f"--topic {topic}: {path} has no depth image on it; it takes one of {images}")
        asked = [topic] if topic else images
        topics = {*asked, *map(_info_topic, asked)}
        with open_bag(path, topics, topics) as bag, telling_damage():
            return _read(bag, asked, topic is None)
    except RecordingError as error:
        raise InputError(f"{path}: {error}") from None


def _info_topic(topic: str) -> str:
    """Where image_transport has compressed images is one level below."""
    return f"{topic.removesuffix('/compressedDepth').rpartition('/')[0]}/{CAMERA_INFO}"


def _read(bag: Bag, topics: list[str], any_of: bool) -> tuple[np.ndarray, Camera | None]:
    decoder = Decoder(bag)

    def last(topic: str, kind: str) -> Any:
        found = bag.found[topic]
        return decoder.fields(found[-1], KINDS[kind]) if found else None

    images = {topic: image for topic in topics if (image := last(topic, "depth")) is not None}
    if any_of:
        images = {topic: image for topic, image in images.items() if decode.is_depth(image)}
        if len(images) != 1:
            raise RecordingError(f"has {len(images)} topics of depth images; --topic takes one of {sorted(bag.kinds)}")
    if not images:
        raise RecordingError(f"no message on topic {topics[0]}")
    ((topic, image),) = images.items()
    with naming(topic):
        depth = decode.depth(image)
    height, width = depth.shape
    info_topic = _info_topic(topic)
    with naming(info_topic):
        info = last(info_topic, "camera_info")
        return depth, None if info is None else decode.camera(info, (height, width))
