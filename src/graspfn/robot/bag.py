"""A bag, as `ros2 bag record` leaves it: one .mcap or .db3 file, either of them compressed as a whole (.zstd), or a
folder of such files, which are the parts of one recording.
"""

from __future__ import annotations

import os
import re
import sqlite3
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import IO, Any
from urllib.parse import quote

import yaml
import zstandard

from graspfn.robot.bounds import MOST_TEXT, Bounds
from graspfn.robot.mcap_file import NO_CHECKSUMS, McapFile, Raw, Topic, inflate, message
from graspfn.robot.trial import RecordingError

SUFFIXES = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")
LIST = "metadata.yaml"  # in which rosbag2 names the parts of a bag
JUMP_NS = 10**9  # that the messages of a topic may go back in a file
MOST_STEPS = 20_000  # thousands of SQLite's instructions


@dataclass
class Bag:
    """found: the messages of each wanted topic, in order of time. kinds: the type on every topic. metadata: MCAP's
    records. flags: what is wrong with it, though it could be read. jumps: where its clock goes back."""

    path: Path
    found: dict[str, list[Raw]]
    metadata: dict[str, dict[str, str]]
    flags: list[str]
    bounds: Bounds
    jumps: list[str] = field(default_factory=list)
    kinds: dict[str, str] = field(default_factory=dict)

    def data(self, raw: Raw) -> bytes:
        """The bytes of a message."""
        return inflate(raw.read(), self.bounds)


def is_bag(path: Path) -> bool:
    """By its name, whether a path is a bag of its own; a folder is by its list, or if its files are named as parts."""
    if path.name.startswith("."):
        return False
    if path.is_dir():
        try:
            names = [child.name for child in path.iterdir() if child.name.endswith(SUFFIXES)]
            part = re.compile(re.escape(path.name) + r"_\d+\.")
            return (path / LIST).exists() or (bool(names) and all(part.match(name) for name in names))
        except OSError:
            return True  # and whoever reads it is told why not
    return path.name.endswith(SUFFIXES)


def parts(path: Path) -> list[Path]:
    """The files of a bag: itself, or those in its folder, all that metadata.yaml names among them."""
    if not path.is_dir():
        return [path]
    found = sorted(child for child in path.iterdir() if child.name.endswith(SUFFIXES) and child.name[0] != ".")
    there = {name for child in found for name in (child.name, child.name.removesuffix(".zstd"))}
    for name in _listed(path / LIST):
        if name not in there:
            raise RecordingError(f"its part {name!r}, which {LIST} names, is not in the folder")
    if not found:
        raise RecordingError(f"holds no {' or '.join(SUFFIXES[:2])} file")
    return found


def _listed(path: Path) -> list[str]:
    if not path.exists():
        return []  # the recorder was killed before it wrote it
    with _opened(path) as stream:
        text = stream.read(MOST_TEXT)
    try:
        names = yaml.load(text, yaml.BaseLoader)["rosbag2_bagfile_information"]["relative_file_paths"]
        return [os.path.basename(name) for name in names]
    except (yaml.YAMLError, KeyError, TypeError, AttributeError, RecursionError):
        raise RecordingError(f"{LIST} is not that of a bag") from None


@contextmanager
def _opened(path: Path) -> Iterator[IO[bytes]]:
    """A regular file, for reading: a pipe would wait for ever."""

    def opener(name: str, flags: int) -> int:
        return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))

    with open(path, "rb", opener=opener) as stream:
        if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            raise RecordingError(f"{path.name} is not a file")
        yield stream


@contextmanager
def telling_damage() -> Iterator[None]:
    """Damaged bytes surface as any of a dozen unrelated types from the mcap, cdr and compression libraries."""
    try:
        yield
    except (RecordingError, OSError):
        raise
    except Exception as error:
        raise RecordingError(f"damaged: {' '.join(f'{type(error).__name__} {error}'.split())}") from error


@contextmanager
def open_bag(path: Path, topics: Iterable[str], lazy: Iterable[str]) -> Iterator[Bag]:
    """The messages of `topics` in a bag; those of `lazy` topics stay in the file until `Bag.data` asks for one.

    Raises RecordingError, in a line, where it cannot be used; OSError where it cannot be read.
    """
    files = parts(path)
    bounds = Bounds(sum(file.stat().st_size for file in files))
    bag = Bag(path, {name: [] for name in topics}, {}, [], bounds)
    with ExitStack() as stack:
        for file in files:
            stream = stack.enter_context(_opened(file))
            name = file.name
            if name.endswith(".zstd"):
                with telling_damage():
                    stream, name = stack.enter_context(_expanded(stream, bounds)), name.removesuffix(".zstd")
            read = _sqlite if name.endswith(".db3") else _mcap
            last: dict[str, int] = {}
            with telling_damage():
                for raw in read(stack, stream, bag, frozenset(lazy)):
                    bag.found[raw.topic.name].append(raw)
                    back = last.get(raw.topic.name, 0) - raw.time_ns
                    last[raw.topic.name] = raw.time_ns
                    if back > JUMP_NS and len(bag.jumps) < 10:
                        jump = f"the recorder's clock goes back by {back * 1e-9:.3g} s"
                        bag.jumps.append(f"topic {raw.topic.name}: {jump}")
        for found in bag.found.values():
            found.sort(key=lambda raw: raw.time_ns)
        bag.flags = list(dict.fromkeys(bag.flags))
        yield bag


@contextmanager
def _expanded(stream: IO[bytes], bounds: Bounds) -> Iterator[IO[bytes]]:
    """A compressed file, expanded into a temporary one."""
    with tempfile.NamedTemporaryFile(prefix="graspfn-") as whole:
        with zstandard.ZstdDecompressor().stream_reader(stream, read_across_frames=True) as reader:
            while block := reader.read(1 << 20):
                bounds.expand(len(block))
                whole.write(block)
        whole.flush()
        yield whole


def _mcap(stack: ExitStack, stream: IO[bytes], bag: Bag, lazy: frozenset[str]) -> Iterator[Raw]:
    file = McapFile(stream, frozenset(bag.found), lazy, bag.bounds)
    yield from file.messages()
    bag.kinds |= {topic.name: topic.kind for topic in file.topics.values()}
    bag.metadata |= file.metadata
    bag.flags += file.flags


def _sqlite(stack: ExitStack, stream: IO[bytes], bag: Bag, lazy: frozenset[str]) -> Iterator[Raw]:
    """rosbag2's other storage, in which a message is a row; a journal that a killed recorder left is not replayed."""
    stream.seek(0)
    if stream.read(16) != b"SQLite format 3\0":
        raise RecordingError("not an SQLite file")
    base = sqlite3.connect(f"file:{quote(os.path.abspath(stream.name))}?mode=ro&immutable=1", uri=True)
    stack.callback(base.close)
    steps = iter(range(MOST_STEPS))
    base.set_progress_handler(lambda: next(steps, None) is None, 1000)
    base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, 1 << 28)
    try:
        topics = dict(_sqlite_topics(base))
        bag.kinds |= {topic.name: topic.kind for topic in topics.values()}
        for number, topic in topics.items():
            if topic.name not in bag.found:
                continue
            content = "NULL" if topic.name in lazy else "data"
            rows = base.execute(f"SELECT id, timestamp, {content} FROM messages WHERE topic_id = ?", (number,))
            for row, time_ns, data in rows:
                bag.bounds.count()
                bag.bounds.hold(500 + len(data or b""))
                if topic.name in lazy:
                    yield Raw(int(time_ns), topic, partial(_row, base, row))
                else:
                    yield message(int(time_ns), topic, bytes(data))
    except sqlite3.Error as error:
        raise RecordingError(f"damaged: {error}") from None
    bag.flags.append(NO_CHECKSUMS)


def _sqlite_topics(base: sqlite3.Connection) -> Iterator[tuple[int, Topic]]:
    tables = {name for (name,) in base.execute("SELECT name FROM sqlite_master")}
    if not {"topics", "messages"} <= tables:
        raise RecordingError("no bag: it lacks the tables 'topics' and 'messages'")
    definitions: dict[str, Any] = {}
    if "message_definitions" in tables:  # since Iron
        asked = "SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding = 'ros2msg'"
        definitions = dict(base.execute(asked).fetchmany(10_000))
    for number, name, kind, encoding in base.execute("SELECT id, name, type, serialization_format FROM topics"):
        yield int(number), Topic(str(name), str(kind), str(encoding), str(definitions.get(kind, "")).encode())


def _row(base: sqlite3.Connection, row: int) -> bytes:
    (data,) = base.execute("SELECT data FROM messages WHERE id = ?", (row,)).fetchone()
    return bytes(data)
