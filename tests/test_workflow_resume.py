"""The loop of long stages: what was done stays done, whatever fails or kills it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from physics_params import PARAMS

from graspfn.workflow import resume
from graspfn.workflow.resume import FailedObjectsError, each_object

NAMES = ("cup", "jug", "mug", "pan")


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the tasks that ran; they run here, last ones first, and so end out of order."""
    ran: list[str] = []

    def backwards(function: Any, tasks: Any, *_: Any, **__: Any) -> Any:
        for name, arguments in reversed(list(tasks)):
            ran.append(name)
            try:
                yield name, function(*arguments)
            except Exception as error:
                yield name, error

    monkeypatch.setattr(resume, "map_objects", backwards)
    return ran


def shards(folder: Path) -> dict[str, Path]:
    return {name: folder / "stage" / f"{name}.npz" for name in NAMES}


def squared(name: str, part: int, broken: tuple[str, ...] = ()) -> tuple[str, int]:
    if name in broken:
        raise ValueError(f"{name} is broken")
    return name, part**2


def run(
    folder: Path, monkeypatch: pytest.MonkeyPatch, broken: tuple[str, ...] = (), max_failed: float = 0.5
) -> tuple[Mapping[str, Mapping[str, np.ndarray]], Mapping[str, str]]:
    monkeypatch.setattr("graspfn.workflow.shards.SCRATCH", folder)

    def pack(parts: list[tuple[str, int]]) -> dict[str, np.ndarray]:
        assert len({name for name, _ in parts}) == 1
        return {"squares": np.array([square for _, square in parts])}

    tasks = lambda name: [(name, part, broken) for part in range(3)]  # noqa: E731
    return each_object("stage", shards(folder), squared, tasks, pack, PARAMS.compute, max_failed, parts=3)


def test_parts_are_put_together_in_order_whatever_order_they_end_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, calls: list[str]
) -> None:
    done, failed = run(tmp_path, monkeypatch)
    assert tuple(done) == NAMES and not failed and len(calls) == 12
    assert all(arrays["squares"].tolist() == [0, 1, 4] for arrays in done.values())


def test_what_was_done_is_not_done_again_and_other_runs_are_swept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, calls: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    first, _ = run(tmp_path, monkeypatch)
    shards(tmp_path)["mug"].unlink()
    (tmp_path / "stage/old.npz").touch()
    calls.clear()
    again, _ = run(tmp_path, monkeypatch)
    assert set(calls) == {"mug/0", "mug/1", "mug/2"}
    assert "3 of 4 objects were done before" in capsys.readouterr().out
    assert {name: a["squares"].tolist() for name, a in again.items()} == {
        n: a["squares"].tolist() for n, a in first.items()
    }
    assert not (tmp_path / "stage/old.npz").exists()


def test_failed_objects_are_left_out_by_name_and_too_many_end_it_with_the_others_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, calls: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    done, failed = run(tmp_path, monkeypatch, broken=("jug",))
    assert set(done) == {"cup", "mug", "pan"} and failed == {"jug": "jug is broken"}
    assert "left out jug: jug is broken" in capsys.readouterr().out
    for path in shards(tmp_path).values():
        path.unlink(missing_ok=True)
    with pytest.raises(FailedObjectsError, match=r"^3 of 4 objects failed; the first, .*: .* is broken$"):
        run(tmp_path, monkeypatch, broken=("cup", "jug", "pan"))
    assert [name for name, path in shards(tmp_path).items() if path.exists()] == ["mug"]
