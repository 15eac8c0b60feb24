"""How much work and memory a bag may cost: by counting, so that the same bag is refused everywhere or nowhere."""

from __future__ import annotations

from dataclasses import dataclass

from graspfn.robot.trial import RecordingError

MOST_CHUNK = 1 << 28  # bytes of a chunk, expanded; rosbag2's default is less than a megabyte
MOST_TEXT = 1 << 20  # bytes of a schema, channel or metadata record
MOST_HELD = 1 << 28  # bytes of a bag's messages in memory at once
MOST_MESSAGES = 3_000_000  # of a bag, on all topics, and other records
MOST_EXPANDED = 1 << 30  # bytes that the compressed parts of a bag may expand to, or
MOST_RATIO = 20  # so many times its size


@dataclass
class Bounds:
    """What has been spent on one bag; RecordingError once it is too much. size: of its files, bytes."""

    size: int
    messages: int = 0
    held: int = 0
    expanded: int = 0

    def count(self) -> None:
        self.messages += 1
        if self.messages > MOST_MESSAGES:
            raise RecordingError(f"more than {MOST_MESSAGES:,} messages; a bag is one trial")

    def hold(self, size: int) -> None:
        self.held += size
        if self.held > MOST_HELD:
            raise RecordingError(f"more than {MOST_HELD >> 20} MiB of poses, joints and transforms; a bag is one trial")

    def expand(self, size: int) -> None:
        self.expanded += size
        if self.expanded > max(MOST_EXPANDED, MOST_RATIO * self.size):
            raise RecordingError(
                f"expands to more than {max(MOST_EXPANDED, MOST_RATIO * self.size) >> 20} MiB; a bag is one trial"
            )
