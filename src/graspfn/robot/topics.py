"""The messages of a bag, by what they are for (`params.Topics`), as their fields."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from graspfn.params import Topics
from graspfn.robot.bag import Bag
from graspfn.robot.mcap_file import Raw
from graspfn.robot.messages import SCHEMAS
from graspfn.robot.trial import RecordingError

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
LAZY = ("depth", "gripper")  # left in the file; of the gripper's commands only the times are of use
THIN_NS = 5_000_000


def wanted(topics: Topics) -> list[str]:
    return [topic for key in (*KINDS, "gripper") if (topic := getattr(topics, key))]


def lazy(topics: Topics) -> list[str]:
    return [topic for key in LAZY if (topic := getattr(topics, key))]


@contextmanager
def naming(topic: str) -> Iterator[None]:
    """Errors say which topic the message came on."""
    try:
        yield
    except RecordingError as error:
        raise RecordingError(f"topic {topic}: {error}") from None


class Decoder:
    """Of the messages of one bag."""

    def __init__(self, bag: Bag):
        self.bag = bag
        self._factory = DecoderFactory()
        self._schemas: dict[Any, Schema] = {}

    def fields(self, raw: Raw, kinds: Sequence[str]) -> Any:
        """A message of one of these types as its fields."""
        topic = raw.topic
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


class Messages:
    """Those of one bag."""

    def __init__(self, bag: Bag, topics: Topics):
        self.bag, self.topics, self._decoder = bag, topics, Decoder(bag)

    def raw(self, key: str) -> list[Raw]:
        topic = getattr(self.topics, key)
        return [] if topic is None else self.bag.found[topic]

    def decode(self, key: str, raw: Raw) -> Any:
        """A message as its fields."""
        return self._decoder.fields(raw, KINDS[key])

    def thinned(self, key: str) -> Iterator[Raw]:
        """Of each publisher on a topic no more than one message in THIN_NS: some publish every millisecond."""
        last: dict[Any, int] = {}
        for raw in self.raw(key):
            data = self.bag.data(raw)
            publisher = len(data), data[12:140]  # the names of its joints, after the stamp
            if raw.time_ns - last.get(publisher, -THIN_NS) >= THIN_NS:
                last[publisher] = raw.time_ns
                yield raw
