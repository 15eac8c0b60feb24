"""artifacts/, the remote that comes along: labels of the paper's scale are found in it by the code of today."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[1]
REMOTE = ROOT / "artifacts"
MOST = 60e6  # bytes that travel with the repository
HOURS = ["place_objects", "label_grasps@train", "label_grasps@test"]


def runs(command: str) -> list[dict[str, Any]]:
    """What the run cache knows of a stage's command."""
    files = (path for path in REMOTE.glob("runs/*/*/*") if path.is_file())
    return [run for run in map(yaml.safe_load, map(Path.read_text, files)) if run["cmd"] == command]


def code(run: dict[str, Any]) -> dict[str, str]:
    return {dep["path"]: dep["md5"] for dep in run["deps"] if not dep["path"].startswith("data/")}


def pushed(md5: str) -> Path:
    return REMOTE / "files/md5" / md5[:2] / md5[2:]


def test_it_is_small() -> None:
    assert sum(path.stat().st_size for path in REMOTE.rglob("*") if path.is_file()) <= MOST


@pytest.mark.parametrize("stage", HOURS)
def test_what_took_hours_is_there_and_of_this_code(stage: str) -> None:
    """A change to what labels depend on has to come with labels made anew, or whoever clones makes them."""
    today = yaml.safe_load((ROOT / "dvc.lock").read_text())["stages"][stage]
    (run,) = runs(today["cmd"])
    assert code(run) == code(today)
    assert run["params"]["params.yaml"].items() >= {"seed": 0}.items()
    for out in run["outs"]:
        assert pushed(out["md5"]).is_file(), out["path"]
