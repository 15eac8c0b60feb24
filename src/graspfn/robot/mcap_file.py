"""The messages of an MCAP file, finished or cut short, read from its first record to its last.

Read in the order of the file: neither an index nor a summary is needed, and none is believed. Whatever a damaged or
hostile file declares, no more is allocated than `bounds` allows.
"""

from __future__ import annotations

import io
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import IO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema, Statistics

from graspfn.robot.bounds import MOST_CHUNK, MOST_TEXT, Bounds
from graspfn.robot.trial import RecordingError

MAGIC = b"\x89MCAP0\r\n"  # first and last bytes of a finished MCAP file
ZSTD = b"\x28\xb5\x2f\xfd"  # of a zstd frame; CDR begins with a zero byte
NO_CHECKSUMS = "no checksums: damage would not show"
CUT = "cut short"
PRIVATE = 0x80  # opcodes from here on are whoever's, and skipped


@dataclass(frozen=True)
class Topic:
    """A topic of a bag. definition: of its type `kind`, empty where the bag has none that is ros2msg."""

    name: str
    kind: str
    encoding: str = "cdr"
    definition: bytes = b""


@dataclass(frozen=True)
class Raw:
    """A message as its bytes. time_ns: when it was logged. read: gives the bytes, from the file if they are many."""

    time_ns: int
    topic: Topic
    read: partial[bytes]


def _kept(data: bytes) -> bytes:
    return data


def message(time_ns: int, topic: Topic, data: bytes) -> Raw:
    return Raw(time_ns, topic, partial(_kept, data))


def inflate(data: bytes, bounds: Bounds) -> bytes:
    """A message's bytes: rosbag2 may have compressed each for itself."""
    return expand(data, "zstd", None, bounds) if data[:4] == ZSTD else data


def expand(data: bytes, compression: str, size: int | None, bounds: Bounds) -> bytes:
    """Decompressed data of `size` bytes, where that is known; never more than a chunk may have."""
    if size is not None and size > MOST_CHUNK:
        raise RecordingError(f"damaged: a chunk that claims {size} bytes")
    if compression == "":
        result = data
    elif compression == "zstd":
        told = zstandard.frame_content_size(data)
        if told > MOST_CHUNK or (size is not None and told not in (-1, size)):
            raise RecordingError(f"damaged: {len(data)} compressed bytes that claim to hold {told}")
        most = MOST_CHUNK if size is None else size
        bounds.expand(max(told, 0))
        result = zstandard.ZstdDecompressor().decompress(data, max_output_size=most) if most else b""
        bounds.expand(len(result) if told < 0 else 0)
    elif compression == "lz4":
        most = MOST_CHUNK if size is None else size
        result = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=most + 1)
        bounds.expand(len(result))
    else:
        raise RecordingError(f"chunk compressed by {compression!r}; it takes zstd, lz4 or none")
    if size is not None and len(result) != size:
        raise RecordingError(f"damaged: a chunk of {len(result)} bytes that claims {size}")
    return result


class McapFile:
    """wanted: topics to read. lazy: those whose messages are left in the file until they are asked for.

    After `messages` is exhausted, topics holds all of them by channel, metadata the metadata records, and flags what is
    wrong with the file.
    """

    def __init__(self, stream: IO[bytes], wanted: frozenset[str], lazy: frozenset[str], bounds: Bounds):
        self._stream, self._wanted, self._lazy, self._bounds = stream, wanted, lazy, bounds
        self._size = stream.seek(0, os.SEEK_END)
        self.metadata: dict[str, dict[str, str]] = {}
        self.flags: list[str] = []
        self._schemas: dict[int, Schema] = {}
        self.topics: dict[int, Topic] = {}
        self._unchecked = self._ended = False
        self._count = 0
        if self._bytes(0, len(MAGIC)) != MAGIC:
            raise RecordingError("not an MCAP file")
        self.finished = self._size >= 2 * len(MAGIC) and self._bytes(self._size - len(MAGIC), len(MAGIC)) == MAGIC

    def _bytes(self, offset: int, length: int) -> bytes:
        self._stream.seek(offset)
        return self._stream.read(length)

    def messages(self) -> Iterator[Raw]:
        """Of the wanted topics, in the order of the file. RecordingError where it is damaged."""
        offset = len(MAGIC)
        while True:
            head = self._bytes(offset, 9)
            opcode, length = struct.unpack("<BQ", head) if len(head) == 9 else (Opcode.FOOTER, self._size)
            body = offset + 9
            if body + length > self._size:
                self._cut(offset)
                break
            if opcode == Opcode.CHUNK:
                yield from self._chunk(body, length)
            elif opcode == Opcode.MESSAGE:
                self._unchecked = True
                yield from self._message(
                    self._bytes(body, min(length, 22)), partial(self._bytes, body + 22, length - 22)
                )
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA):
                self._describe(opcode, self._text(body, length))
            elif opcode == Opcode.DATA_END:
                self._check_data(body, offset)
            elif opcode == Opcode.STATISTICS:
                self._check_count(self._text(body, length))
            elif opcode == Opcode.FOOTER:
                break
            elif not Opcode.HEADER <= opcode <= Opcode.DATA_END and opcode < PRIVATE:
                raise RecordingError(f"damaged: no record begins at byte {offset}")
            self._bounds.count()
            offset = body + length
        if self._unchecked:
            self.flags.append(NO_CHECKSUMS)

    def _cut(self, offset: int) -> None:
        if self.finished:
            raise RecordingError(f"damaged: the record at byte {offset} is longer than the file")
        if self._ended:
            return  # of what is left out nothing is needed
        self.flags.append(f"{CUT}: read up to byte {offset} of {self._size}")

    def _text(self, body: int, length: int) -> bytes:
        if length > MOST_TEXT:
            raise RecordingError(f"damaged: a description of {length} bytes")
        self._bounds.hold(length)
        return self._bytes(body, length)

    def _describe(self, opcode: int, body: bytes) -> None:
        stream = ReadDataStream(io.BytesIO(body))
        if opcode == Opcode.METADATA:
            record = Metadata.read(stream)
            self.metadata[record.name] = dict(record.metadata)
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            if self._schemas.setdefault(schema.id, schema) != schema:
                raise RecordingError(f"damaged: two different schemas with the id {schema.id}")
        else:
            channel = Channel.read(stream)
            found = self._schemas.get(channel.schema_id)
            definition = found.data if found and found.encoding == "ros2msg" else b""
            topic = Topic(channel.topic, found.name if found else "no type", channel.message_encoding, definition)
            if self.topics.setdefault(channel.id, topic) != topic:
                raise RecordingError(f"damaged: two different channels with the id {channel.id}")

    def _chunk_data(self, body: int, length: int) -> tuple[bytes, int]:
        """The records of a chunk, and their checksum as the file has it."""
        head = self._bytes(body, min(length, 64))
        size, crc, name_length = struct.unpack_from("<QII", head, 16)
        compression = head[32 : 32 + name_length].decode()
        (stored,) = struct.unpack_from("<Q", head, 32 + name_length)
        start = 40 + name_length
        if start + stored != length:
            raise RecordingError(f"damaged: a chunk of {length} bytes that claims {start + stored}")
        if stored > MOST_CHUNK:
            raise RecordingError(f"a chunk of {stored} bytes; it takes up to {MOST_CHUNK}")
        return expand(self._bytes(body + start, stored), compression, size, self._bounds), crc

    def _chunk(self, body: int, length: int) -> Iterator[Raw]:
        data, crc = self._chunk_data(body, length)
        if crc and zlib.crc32(data) != crc:
            raise RecordingError("damaged: a chunk's checksum is another")
        self._unchecked |= not crc
        offset, end = 0, len(data)
        while offset < end:
            if end - offset < 9:
                raise RecordingError("damaged: a chunk ends within a record")
            opcode, size = struct.unpack_from("<BQ", data, offset)
            at = offset + 9
            if size > end - at:
                raise RecordingError("damaged: a record is longer than its chunk")
            if opcode == Opcode.MESSAGE:
                read = partial(self._from_chunk, body, length, at + 22, at + size)
                yield from self._message(data[at : at + min(size, 22)], read, memoryview(data)[at + 22 : at + size])
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                if size > MOST_TEXT:
                    raise RecordingError(f"damaged: a description of {size} bytes")
                self._describe(opcode, data[at : at + size])
            elif opcode < PRIVATE:
                raise RecordingError("damaged: a chunk holds what is no record of its kind")
            self._bounds.count()
            offset = at + size

    def _from_chunk(self, body: int, length: int, start: int, stop: int) -> bytes:
        return self._chunk_data(body, length)[0][start:stop]

    def _message(self, head: bytes, read: partial[bytes], data: memoryview | None = None) -> Iterator[Raw]:
        self._count += 1
        if len(head) < 22:
            raise RecordingError("damaged: a message of fewer bytes than its times take")
        channel, _, time_ns = struct.unpack_from("<HIQ", head)
        topic = self.topics.get(channel)
        if topic is None:
            raise RecordingError(f"damaged: a message on channel {channel}, which nothing before it describes")
        if topic.name not in self._wanted:
            return
        if topic.name in self._lazy:
            self._bounds.hold(500)
            yield Raw(time_ns, topic, read)
            return
        kept = read() if data is None else bytes(data)
        self._bounds.hold(500 + len(kept))
        yield message(time_ns, topic, kept)

    def _check_data(self, body: int, end: int) -> None:
        """The checksum over all before the end of the data, where there is one."""
        self._ended = True
        (expected,) = struct.unpack("<I", self._bytes(body, 4))
        if not expected:
            return
        self._stream.seek(0)
        crc, left = 0, end
        while left:
            block = self._stream.read(min(left, 1 << 20))
            crc, left = zlib.crc32(block, crc), left - len(block)
        if crc != expected:
            raise RecordingError("damaged: the checksum of its data is another")
        self._unchecked = False

    def _check_count(self, body: bytes) -> None:
        """A chunk whose kind is damaged would be passed over as something else."""
        said = Statistics.read(ReadDataStream(io.BytesIO(body))).message_count
        if said != self._count:
            raise RecordingError(f"damaged: {self._count} messages, where its statistics count {said}")
