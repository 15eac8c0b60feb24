"""reports/ and dvc.lock are what the committed code and parameters produced."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

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
