"""reports/ and dvc.lock are what the committed code and parameters produced."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

from graspfn.reporting.summary import in_readme, results_sentence

ROOT = Path(__file__).parents[1]


def test_repro_has_nothing_to_do(tmp_path: Path) -> None:
    env = dict(os.environ)
    if not (ROOT / ".git").exists():  # an unpacked archive
        (tmp_path / "config").write_text("[core]\nno_scm = true\n")
        env["DVC_SYSTEM_CONFIG_DIR"] = str(tmp_path)
    command = ["dvc", "repro", "--dry", "--allow-missing"]
    done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stdout.splitlines() if line.startswith("Running stage")] == []


def test_readme_says_the_results_of_the_run() -> None:
    """Those of the paper's scale, between the markers <!-- results --> and <!-- /results -->."""
    metrics = json.loads((ROOT / "reports/paper/metrics.json").read_text())
    assert in_readme((ROOT / "README.md").read_text()) == results_sentence(metrics)
