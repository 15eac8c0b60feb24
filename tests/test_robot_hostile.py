"""Bags that are damaged, or made to do harm: one line each, no wrong number, no memory or time without bounds."""

from __future__ import annotations

import itertools
import json
import os
import sqlite3
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import zstandard
from made_bags import ACHIEVED, ARM, COMMANDED, ENCODERS, SAID, TOPICS, arm, at, entries, write_mcap
from mcap.writer import CompressionType

from graspfn.robot import bounds, messages
from graspfn.robot.analyse import analyse
from graspfn.robot.described import describe
from graspfn.robot.mcap_file import MAGIC
from graspfn.robot.read import read_trial, recordings
from graspfn.robot.trial import RecordingError

FEW = [entry for i, entry in enumerate(entries()) if i % 4 == 0 or entry[1] not in (TOPICS.depth, TOPICS.camera_info)]
TINY = [entry for entry in entries() if entry[1] not in (TOPICS.joints, TOPICS.tf)][:8]


def refused(path, tf=ARM) -> str:
    """The one line that says why."""
    with pytest.raises(RecordingError) as error:
        read_trial(path, TOPICS, tf)
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)
    assert len(str(error.value)) < 2000
    return str(error.value)


def refused_or_same(path, flagged=False) -> bool:
    """Whether it was refused; else every number is that of the whole bag, or it says that it is cut."""
    try:
        back = read_trial(path, TOPICS, ARM)
    except RecordingError as error:
        assert str(error).startswith(f"{path}: ") and "\n" not in str(error)
        return True
    np.testing.assert_allclose(back.commanded, COMMANDED)
    np.testing.assert_allclose(back.achieved, ACHIEVED, atol=1e-9)
    np.testing.assert_allclose(back.depth, 0.4, atol=1e-6)
    assert back.success
    return False


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD])
def test_bits_flipped_anywhere_are_refused_or_harmless(tmp_path, compression):
    whole = write_mcap(tmp_path / "a.mcap", FEW, None, compression=compression, chunk_size=30_000).read_bytes()
    path, rng, count = tmp_path / "bad.mcap", np.random.default_rng(0), 0
    describe(tmp_path / "a.mcap", SAID)
    (tmp_path / "a.mcap.trial.yaml").rename(tmp_path / "bad.mcap.trial.yaml")
    # Where records begin a byte decides over thousands: as many flips there as anywhere.
    starts = record_starts(whole)
    for i in range(120):
        bad = bytearray(whole)
        place = int(rng.integers(len(bad))) if i % 2 else int(rng.choice(starts)) + int(rng.integers(48))
        bad[min(place, len(bad) - 1)] ^= 1 << int(rng.integers(8))
        path.write_bytes(bad)
        count += refused_or_same(path)
    assert count > 30


def test_cuts_anywhere_are_refused_or_flagged_or_after_all_that_counts(tmp_path):
    whole = write_mcap(tmp_path / "a.mcap", FEW, None, chunk_size=30_000).read_bytes()
    path, rng, count = tmp_path / "bad.mcap", np.random.default_rng(1), 0
    describe(tmp_path / "a.mcap", SAID)
    (tmp_path / "a.mcap.trial.yaml").rename(tmp_path / "bad.mcap.trial.yaml")
    for _ in range(40):
        path.write_bytes(whole[: int(rng.integers(len(whole)))])
        count += refused_or_same(path)
    assert count > 20


READER = """
import json, resource, sys, time
from pathlib import Path
from made_bags import ARM, TOPICS
from graspfn.robot.analyse import trial_row
from graspfn.robot.trial import RecordingError

def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024

first, *others = (Path(name) for name in sys.argv[1:])
found, _ = {}, trial_row(first, TOPICS, ARM)
before = peak()
for path in [first, *others]:
    started = time.process_time()
    try:
        row, error = trial_row(path, TOPICS, ARM), ""
    except RecordingError as refused:
        row, error = None, str(refused)
    found[path.name] = row, error, time.process_time() - started
print(json.dumps([found, peak() - before]))
"""


def damaged(whole: bytes, rng: np.random.Generator) -> bytes:
    """Cut, with bits flipped where records begin or anywhere, a piece twice, or a piece gone."""
    bad = bytearray(whole)
    kind, place = int(rng.integers(5)), int(rng.integers(len(whole)))
    piece = slice(place, place + int(rng.integers(1, 5000)))
    if kind == 0:
        return whole[:place]
    if kind == 1:
        return whole[: piece.stop] + whole[place:]
    if kind == 2:
        return whole[:place] + whole[piece.stop :]
    starts = record_starts(whole)
    for _ in range(int(rng.integers(1, 4))):
        place = int(rng.choice(starts)) + int(rng.integers(40)) if kind == 3 else int(rng.integers(len(whole)))
        bad[min(place, len(bad) - 1)] ^= 1 << int(rng.integers(8))
    return bytes(bad)


def test_two_hundred_hostile_files_cost_bounded_memory_and_time_and_give_no_wrong_number(tmp_path, bombs):
    """In a process of its own, whose peak of memory is that of the worst of them."""
    whole = write_mcap(tmp_path / "whole.mcap", FEW, None, compression=CompressionType.ZSTD, chunk_size=30_000)
    rng = np.random.default_rng(7)
    files = {f"damaged-{i}.mcap": damaged(whole.read_bytes(), rng) for i in range(180)}
    for told, (size, data) in bombs.items():
        for claim in (size, 100, 3 << 30, 2**64 - 1):
            files[f"bomb-{told}-{claim}.mcap"] = MAGIC + chunk("zstd", claim, data)
        files[f"bomb-{told}.mcap.zstd"] = data
        files[f"bomb-{told}.db3.zstd"] = data
    files["bomb-within-bounds.mcap"] = MAGIC + chunk("zstd", bounds.MOST_CHUNK, zeros(bounds.MOST_CHUNK, True))
    files |= {f"noise-{i}.{kind}": rng.bytes(5000) for i in range(4) for kind in ("mcap", "db3", "mcap.zstd")}
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
        describe(tmp_path / name, SAID)
    describe(whole, SAID)
    folders = [str(Path(__file__).parent), *filter(None, sys.path)]
    done = subprocess.run(
        [sys.executable, "-c", READER, whole, *(tmp_path / name for name in files)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(folders)}, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    found, grown_mib = json.loads(done.stdout)
    assert set(found) == {whole.name, *files} and len(files) > 200
    right, _, _ = found.pop(whole.name)
    numbers = ("u_m", "v_m", "theta_rad", "reached_u_m", "reached_v_m", "reached_theta_rad", "success", "object")
    for name, (row, error, seconds) in found.items():
        assert seconds < 10, name  # of the processor's clock, however busy the machine
        assert (row is None) == bool(error) and "\n" not in error, name
        if row is not None:
            assert [row[key] for key in numbers] == [right[key] for key in numbers], name
    assert sum(row is None for row, _, _ in found.values()) > 100
    assert grown_mib < 700  # a chunk of 256 MiB, and what is made of it


def record_starts(data: bytes) -> list[int]:
    found, offset = [], len(MAGIC)
    while offset + 9 <= len(data) - len(MAGIC):
        found.append(offset)
        offset += 9 + struct.unpack_from("<Q", data, offset + 1)[0]
    return found


def test_records_of_impossible_lengths(tmp_path):
    """Every record of a small file, with every kind of wrong length: well over a hundred files."""
    whole = write_mcap(tmp_path / "a.mcap", TINY, SAID, compression=CompressionType.ZSTD, chunk_size=9000).read_bytes()
    path, made = tmp_path / "bad.mcap", 0
    for start in record_starts(whole):
        for length in (0, 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1):
            bad = bytearray(whole)
            struct.pack_into("<Q", bad, start + 1, length)
            path.write_bytes(bad)
            try:
                read_trial(path, TOPICS, ARM)
            except RecordingError as error:
                assert "\n" not in str(error)
            made += 1
    assert made > 100


def record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def chunk(compression: str, size: int, data: bytes, crc: int = 0) -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, crc) + text(compression)
    return record(6, head + struct.pack("<Q", len(data)) + data)


def zeros(size: int, told: bool) -> bytes:
    """A zstd frame of so many zeros; told: it says how many."""
    packer = (
        zstandard.ZstdCompressor(level=1).compressobj(size=size) if told else zstandard.ZstdCompressor(1).compressobj()
    )
    block = bytes(1 << 24)
    parts = [packer.compress(block[: min(len(block), size - at)]) for at in range(0, size, len(block))]
    return b"".join(parts) + packer.flush()


@pytest.fixture(scope="module")
def bombs():
    """Small frames that expand to more than a chunk may hold."""
    size = bounds.MOST_CHUNK + (1 << 24)
    return {told: (size, zeros(size, told)) for told in (True, False)}


@pytest.mark.parametrize("told", [True, False])
@pytest.mark.parametrize("claim", [None, 100, 3 << 30, 2**64 - 1])
def test_a_chunk_that_expands_to_gigabytes(tmp_path, bombs, told, claim):
    size, data = bombs[told]
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + record(1, text("ros2") + text("")) + chunk("zstd", size if claim is None else claim, data))
    assert "damaged" in refused(path)


def test_many_chunks_that_expand_to_gigabytes_together(tmp_path, monkeypatch):
    monkeypatch.setattr(bounds, "MOST_EXPANDED", 1 << 26)
    size = 1 << 24
    private = zstandard.compress(struct.pack("<BQ", 0x80, size - 9) + bytes(size - 9))  # a record to be passed over
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + 20 * chunk("zstd", size, private))
    assert "expands to more than 64 MiB" in refused(path)


def test_a_chunk_of_millions_of_empty_records(tmp_path, monkeypatch):
    monkeypatch.setattr(bounds, "MOST_MESSAGES", 1000)
    size = 9 * (1 << 16)
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + chunk("zstd", size, zeros(size, True)))
    assert "no record of its kind" in refused(path)
    path.write_bytes(MAGIC + chunk("", size, struct.pack("<BQ", 0x80, 0) * (1 << 16)))
    assert "more than 1,000 messages" in refused(path)


def test_a_whole_file_that_expands_to_gigabytes(tmp_path, monkeypatch):
    monkeypatch.setattr(bounds, "MOST_EXPANDED", 1 << 26)
    monkeypatch.setattr(bounds, "MOST_RATIO", 1)
    (tmp_path / "a.mcap.zstd").write_bytes(zeros(1 << 27, False))
    assert "expands to more than 64 MiB" in refused(tmp_path / "a.mcap.zstd")


def test_messages_compressed_to_gigabytes(tmp_path, bombs, monkeypatch):
    import made_bags

    packed = ENCODERS | {"sensor_msgs/msg/JointState": lambda message: bombs[True][1]}
    monkeypatch.setattr(made_bags, "ENCODERS", packed)
    assert "that claim to hold" in refused(write_mcap(tmp_path / "a.mcap", entries()))


def test_more_messages_or_bytes_than_a_trial_has(tmp_path, monkeypatch):
    path = write_mcap(tmp_path / "a.mcap", entries())
    monkeypatch.setattr(bounds, "MOST_MESSAGES", 1000)
    assert "more than 1,000 messages" in refused(path)
    monkeypatch.setattr(bounds, "MOST_MESSAGES", 10_000)
    monkeypatch.setattr(bounds, "MOST_HELD", 1 << 18)
    assert "more than 0 MiB" in refused(path)


RUBBISH = {
    "nothing": b"",
    "zeros": b"\0" * 40,
    "a head of zstd": b"\x28\xb5\x2f\xfd" + b"\xff" * 40,
    "noise": np.random.default_rng(3).bytes(64),
}


@pytest.mark.parametrize("compression", ["lz4", "zstd", "snappy", "\N{SNOWMAN}", ""], ids=ascii)
@pytest.mark.parametrize("data", RUBBISH)
def test_chunks_of_rubbish(tmp_path, compression, data):
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + chunk(compression, 1000, RUBBISH[data]))
    refused(path)


def cdr(*parts: bytes) -> bytes:
    return b"\0\1\0\0" + b"".join(parts)


HUGE = struct.pack("<I", 2**32 - 1)
STAMP = struct.pack("<iI", 1, 2) + struct.pack("<I", 1) + b"\0" + b"\0" * 3


@pytest.mark.parametrize(
    "topic", [key for key in ("depth", "camera_info", "commanded", "joints", "outcome", "tf", "tf_static")]
)
@pytest.mark.parametrize(
    "data",
    [b"", b"\0", cdr(), cdr(HUGE), cdr(STAMP, HUGE, HUGE), cdr(b"\xff" * 300), cdr(STAMP, HUGE * 99)],
    ids=range(7),
)
def test_messages_of_rubbish(tmp_path, monkeypatch, topic, data):
    """Counts of four thousand million strings, joints, transforms and bytes among it."""
    import made_bags

    name = getattr(TOPICS, topic)
    kinds = {entry[2] for entry in FEW if entry[1] == name}
    found = [entry for entry in FEW if entry[1] != name or topic not in ("depth", "camera_info") or entry[0] < at(0.2)]
    monkeypatch.setattr(made_bags, "ENCODERS", ENCODERS | {kind: lambda message: data for kind in kinds})
    path = write_mcap(tmp_path / "a.mcap", found, SAID)
    if topic != "outcome" or len(data) < 5:
        refused(path)


SCHEMAS = [
    b"",
    b"\xff\xfe",
    b"std_msgs/Header header\n",
    b"geometry_msgs/PoseStamped again\n",
    b"a/B b\n" + b"=" * 80 + b"\nMSG: a/B\na/B[10] b\n",
    b"float64[4000000000] x\n",
    b"bool[4000000000] x\n",
    b"string<=4 " + b"x" * 10_000 + b"\n",
    "".join(f"a/T0 t\n{'=' * 80}\n" + f"MSG: a/T{i}\na/T{i + 1}[100] t\n" for i in range(12)).encode(),
]


@pytest.mark.parametrize("definition", SCHEMAS, ids=range(len(SCHEMAS)))
def test_definitions_of_rubbish(tmp_path, monkeypatch, definition):
    kind = "geometry_msgs/msg/PoseStamped"
    monkeypatch.setitem(messages.SCHEMAS, kind, definition.decode("latin-1"))
    refused(write_mcap(tmp_path / "a.mcap", FEW, SAID))


def database(path, *statements):
    with sqlite3.connect(path) as base:
        for statement in statements:
            base.execute(*(statement if isinstance(statement, tuple) else (statement,)))
    base.close()
    return path


TABLES = (
    "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)",
    "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)",
    f"INSERT INTO topics VALUES (1, '{TOPICS.commanded}', 'geometry_msgs/msg/PoseStamped', 'cdr')",
)
FOREVER = (
    "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) "
    "SELECT x AS id, 1 AS topic_id, x AS timestamp, '' AS data FROM c"
)


@pytest.mark.parametrize(
    "statements",
    [
        (),
        TABLES[:1],
        TABLES[:2],
        TABLES,
        (*TABLES, "INSERT INTO messages VALUES (1, 1, 'soon', x'00')"),
        (*TABLES, "INSERT INTO messages VALUES (1, 1, NULL, x'00')"),
        (*TABLES, "INSERT INTO messages VALUES (1, 1, 1, NULL)"),
        (*TABLES, "INSERT INTO messages VALUES (1, 1, 1, 'text')"),
        (*TABLES, "INSERT INTO messages VALUES (1, 1, 1, 17000000000)"),
        (*TABLES, "INSERT INTO messages VALUES (1, 1, 1, zeroblob(400000000))"),
        (*TABLES, ("INSERT INTO topics VALUES (2, ?, ?, ?)", (b"\xff", b"\xff", 3))),
        (TABLES[0], TABLES[2], f"CREATE VIEW messages AS {FOREVER}"),
        (TABLES[1], "CREATE VIEW topics AS SELECT id, 'a' AS name, 'b' AS type, 'cdr' AS serialization_format "
         f"FROM ({FOREVER}) WHERE id < 0"),
        (*TABLES, "DROP TABLE messages", "CREATE TABLE messages(a, b)"),
    ],
    ids=itertools.count(),
)  # fmt: skip
def test_databases_that_are_no_bag(tmp_path, statements):
    path = database(tmp_path / "a.db3", *statements)
    describe(path, SAID)
    refused(path)


def test_a_damaged_database_is_refused_or_the_same(tmp_path):
    """Random damage to a .db3, which has no checksums: never another exception."""
    path, rng = tmp_path / "a.db3", np.random.default_rng(2)
    database(path, *TABLES, *[("INSERT INTO messages VALUES (?, 1, ?, ?)", (i, i, rng.bytes(300))) for i in range(50)])
    describe(path, SAID)
    whole = path.read_bytes()
    for i in range(60):
        bad = bytearray(whole)
        if i % 3 == 0:
            del bad[int(rng.integers(len(bad))) :]
        for _ in range(8 if bad else 0):
            bad[int(rng.integers(len(bad)))] ^= int(rng.integers(1, 256))
        path.write_bytes(bad)
        refused(path)


def test_things_that_are_no_files(tmp_path):
    """A pipe would wait for ever; a device has no end."""
    os.mkfifo(tmp_path / "pipe.mcap")
    (tmp_path / "zero.mcap").symlink_to("/dev/zero")
    (tmp_path / "loop.mcap").symlink_to("loop.mcap")
    (tmp_path / "gone.mcap").symlink_to("nowhere")
    (tmp_path / "folder.mcap").mkdir()
    (tmp_path / "empty.db3").touch()
    (tmp_path / "empty.mcap.zstd").touch()
    (tmp_path / "bag").mkdir()
    os.mkfifo(tmp_path / "bag/bag_0.mcap")
    names = ["bag", "empty.db3", "empty.mcap.zstd", "folder.mcap", "gone.mcap", "loop.mcap", "pipe.mcap", "zero.mcap"]
    found = [path.name for path in recordings(tmp_path)]
    assert found == [name for name in names if name != "folder.mcap"]  # an empty folder is no bag
    for name in names:
        refused(tmp_path / name)


@pytest.mark.parametrize(
    "listed",
    [
        "rosbag2_bagfile_information: 3",
        "rosbag2_bagfile_information:\n  relative_file_paths: {a: b}",
        "rosbag2_bagfile_information:\n  relative_file_paths: [../../../etc/passwd]",
        "rosbag2_bagfile_information:\n  relative_file_paths: [[a], [b]]",
        "a: &a [x, x]\n" + "".join(f"b{i}: &b{i} [*{'a' if not i else f'b{i - 1}'}, *a]\n" for i in range(99)),
        "{" * 3000,
        "\0",
    ],
    ids=range(7),
)
def test_lists_of_parts_that_are_none(tmp_path, listed):
    write_mcap(tmp_path / "bag_0.mcap", TINY)
    (tmp_path / "metadata.yaml").write_text(listed)
    refused(tmp_path)


def test_three_bad_bags_of_a_folder_are_three_lines(tmp_path):
    for i in range(4):
        write_mcap(tmp_path / f"good_{i}.mcap", FEW, SAID | {"placement": str(i)})
    (tmp_path / "bad_0.mcap").write_bytes(b"FROM ros:jazzy")
    os.mkfifo(tmp_path / "bad_1.mcap")
    write_mcap(tmp_path / "bad_2.mcap", FEW, None)
    done = analyse(recordings(tmp_path), TOPICS, arm())
    assert done.unused["file"].tolist() == ["bad_0.mcap", "bad_1.mcap", "bad_2.mcap"]
    assert len(done.trials) == 4
    for reason, says in zip(done.unused["reason"], ("not an MCAP", "is not a file", "graspfn trial"), strict=True):
        assert says in reason and "\n" not in reason
