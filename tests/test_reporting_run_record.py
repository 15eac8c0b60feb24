"""provenance.json says what made the report, and what it says can be checked."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import yaml
from physics_params import PARAMS

from graspfn.params import validate
from graspfn.reporting.run_record import commit, lock_digest, run_record


def git(folder: Path, *command: str) -> str:
    who = ["-c", "user.name=t", "-c", "user.email=t@example.org", "-c", "commit.gpgsign=false"]
    return subprocess.run(["git", *who, *command], cwd=folder, capture_output=True, text=True, check=True).stdout


def test_the_parameters_that_it_holds_are_those_of_the_run(tmp_path):
    """All of them but compute: with it they are a params.yaml again."""
    record = json.loads(json.dumps(run_record(PARAMS, {"train@fcn-0": 90.0}, tmp_path)))
    compute = json.loads(json.dumps(vars(PARAMS.compute)))
    assert validate(record["params"] | {"compute": compute}) == PARAMS
    assert record["hours"] == {"train@fcn-0": 0.025}
    assert record["commit"] is None and record["dvc_lock"] is None
    assert record["versions"]["dartpy"] and record["machine"]["cores"] >= 1


def test_the_commit_is_the_one_checked_out_and_a_change_shows(tmp_path):
    git(tmp_path, "init", "-q")
    for name in ("code.py", "dvc.lock"):
        (tmp_path / name).write_text("one")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "one")
    head = git(tmp_path, "rev-parse", "HEAD").strip()
    assert commit(tmp_path) == {"id": head, "changed": False}
    (tmp_path / "dvc.lock").write_text("two")  # as every run writes it
    (tmp_path / "new.txt").write_text("not yet known to git")
    assert commit(tmp_path) == {"id": head, "changed": False}
    (tmp_path / "code.py").write_text("two")
    assert commit(tmp_path) == {"id": head, "changed": True}


def test_the_digest_is_of_every_stage_but_the_report(tmp_path):
    path = tmp_path / "dvc.lock"

    def digest(**stages: str) -> str | None:
        lines = {name: {"outs": [{"path": name, "md5": md5}]} for name, md5 in stages.items()}
        path.write_text(yaml.safe_dump({"stages": lines}))
        return lock_digest(path)

    first = digest(train="a", report="b")
    assert digest(train="a", report="c") == first == digest(train="a")
    assert digest(train="b", report="b") != first
