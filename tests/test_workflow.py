"""Seeds, atomic files, shards and the parallel map."""

from __future__ import annotations

import itertools
import os
import re
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from graspfn.params import Compute
from graspfn.seeds import generator, seed_of
from graspfn.workflow.files import atomic, read_npz, write_npz, write_parquet
from graspfn.workflow.parallel import AHEAD, map_in_order, map_objects
from graspfn.workflow.shards import code_digest, shard_key


def compute(workers: int) -> Compute:
    return Compute(address=None, workers=workers, device="cpu", checkpoint_s=60.0, loaders=0)


def draw(name: str) -> float:
    time.sleep(0.01 * (hash(name) % 3))
    return float(generator(0, "draw", name).random())


def die_if_told(name: str) -> str:
    if name == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    if name == "fails":
        raise ValueError("not this one")
    return name.upper()


def test_seeds_depend_on_every_name_and_on_nothing_else() -> None:
    assert seed_of(0, "a", "b") == seed_of(0, "a", "b")
    assert len({seed_of(0, "a", "b"), seed_of(1, "a", "b"), seed_of(0, "ab"), seed_of(0, "b", "a")}) == 4
    assert generator(3, "x").random() == generator(3, "x").random()


def test_the_number_of_workers_changes_nothing() -> None:
    tasks = [(name, (name,)) for name in "abcdefgh"]
    one, two = (dict(map_objects(draw, tasks, len(tasks), compute(n), "draw")) for n in (1, 2))
    assert one == two == {name: draw(name) for name in "abcdefgh"}


def test_a_task_that_kills_its_worker_costs_itself_alone() -> None:
    tasks = [(name, (name,)) for name in ("one", "dies", "two", "fails", "three")]
    found = dict(map_objects(die_if_told, tasks, len(tasks), compute(2), "die"))
    assert {name: found[name] for name in ("one", "two", "three")} == {"one": "ONE", "two": "TWO", "three": "THREE"}
    assert "killed its worker" in str(found["dies"])
    assert "not this one" in str(found["fails"])


def test_a_map_in_order_may_have_no_end() -> None:
    """Results come in the order of the tasks, however long each takes, until the caller has had enough."""
    tasks = ((name, (name,)) for name in map(str, itertools.count()))
    found = list(itertools.islice(map_in_order(draw, tasks, 12, compute(2), "draw"), 12))
    assert found == [(str(k), draw(str(k))) for k in range(12)]


def slow_if_first(name: str) -> str:
    time.sleep(2.0 if name == "0" else 0.0)
    return name


def test_a_slow_first_task_does_not_let_the_others_run_away() -> None:
    issued = []

    def tasks() -> Iterator[tuple[str, tuple[str]]]:
        for name in map(str, itertools.count()):
            issued.append(name)
            yield name, (name,)

    assert next(iter(map_in_order(slow_if_first, tasks(), 1, compute(2), "slow")))[0] == "0"
    assert len(issued) <= 2 * AHEAD


def test_the_bar_tells_objects_and_attempts_a_second_and_the_time_left(capsys: pytest.CaptureFixture[str]) -> None:
    tasks = [(f"{name}/{part}", (f"{name}/{part}",)) for name in "ab" for part in range(3)]
    for _ in map_objects(draw, tasks, len(tasks), compute(1), "bar", parts=3, attempts=lambda drawn: 700):
        time.sleep(0.15)  # longer than the bar waits before it shows itself anew
    shown = capsys.readouterr().err.split("\r")
    frame = r"bar: .* 1\.00/2\.00 \[\d\d:\d\d<00:0\d, +[\d.]+ ?(object/s|s/object), \d+ attempts/s\]"
    assert any(re.search(frame, line) for line in shown), shown
    rate = int(re.findall(r"(\d+) attempts/s", shown[-1])[0])
    assert 0 < rate < 6 * 700 / (5 * 0.15)  # five waits before the sixth result


def test_no_tasks_start_no_cluster() -> None:
    assert list(map_objects(draw, [], 0, compute(1), "none")) == []


def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "file.txt"
    path.write_text("old")
    with pytest.raises(RuntimeError), atomic(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_npz_round_trip_and_equal_bytes(tmp_path: Path) -> None:
    arrays = {"ids": np.array(["a", "bc"]), "f": np.arange(6, dtype=np.float32).reshape(2, 3), "n": np.array(5)}
    write_npz(tmp_path / "a.npz", arrays)
    time.sleep(0.01)
    write_npz(tmp_path / "b.npz", dict(reversed(arrays.items())))
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    for name, array in read_npz(tmp_path / "a.npz").items():
        np.testing.assert_array_equal(array, arrays[name])


def test_npz_are_compressed(tmp_path: Path) -> None:
    write_npz(tmp_path / "a.npz", {"zeros": np.zeros(10**6, dtype=np.uint8)})
    assert (tmp_path / "a.npz").stat().st_size < 10_000


def test_a_truncated_npz_is_one_line(tmp_path: Path) -> None:
    write_npz(tmp_path / "a.npz", {"f": np.zeros(100)})
    data = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "a.npz").write_bytes(data[: len(data) // 2])
    with pytest.raises(ValueError, match=r"a\.npz: not a readable"):
        read_npz(tmp_path / "a.npz")


def test_parquet_bytes_depend_on_the_table_alone(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_parquet(tmp_path / name, pd.DataFrame({"x": [1.5, 2.5], "s": ["p", "q"]}))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_shard_is_named_after_everything_it_depends_on(tmp_path: Path) -> None:
    mesh = tmp_path / "mesh.ply"
    mesh.write_bytes(b"one")
    key = shard_key("name", mesh, [1.0], compute(1))
    assert key == shard_key("name", mesh, [1.0], compute(1))
    assert key != shard_key("name", mesh, [1.5], compute(1))
    assert key != shard_key("name", mesh, [1.0], compute(2))
    mesh.write_bytes(b"two")
    assert key != shard_key("name", mesh, [1.0], compute(1))


def test_code_digest_covers_the_rooms_named() -> None:
    assert code_digest("physics", "meshes") == code_digest("meshes", "physics") != code_digest("physics")
