"""How many cores a process may use, and that nothing here uses more."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from graspfn.workflow import cores as module
from graspfn.workflow.cores import GRANTS, cores

MACHINE = 128
ALLOWED = os.sched_getaffinity(0) if sys.platform == "linux" else {0}


@pytest.fixture(autouse=True)
def machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """128 cores, no limits."""
    monkeypatch.setattr(os, "cpu_count", lambda: MACHINE)
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(MACHINE)), raising=False)
    monkeypatch.setattr(module, "CGROUPS", tmp_path / "cgroup")
    monkeypatch.setattr(module, "MEMBERSHIP", tmp_path / "membership")
    for name in GRANTS:
        monkeypatch.delenv(name, raising=False)


def confine(folder: Path, membership: str, files: dict[str, str]) -> None:
    (folder / "membership").write_text(membership)
    for name, text in files.items():
        path = folder / "cgroup" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def test_without_limits_it_is_the_machine() -> None:
    assert cores() == MACHINE


def test_affinity(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {3, 7})
    assert cores() == 2


def test_a_slurm_job(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLURM_CPUS_ON_NODE", "8")
    assert cores() == 8
    monkeypatch.setenv("SLURM_CPUS_PER_TASK", "4")
    assert cores() == 4
    monkeypatch.setenv("SLURM_CPUS_PER_TASK", "a few")
    assert cores() == MACHINE


@pytest.mark.parametrize(
    ("membership", "files", "count"),
    [
        ("0::/\n", {"cpu.max": "200000 100000\n"}, 2),
        ("0::/\n", {"cpu.max": "max 100000\n"}, MACHINE),
        ("0::/\n", {"cpu.max": "50000 100000\n"}, 1),
        ("0::/\n", {"cpu.max": "250000 100000\n"}, 3),
        # a limit above the group of the process, and a wider one of its own
        ("0::/a/b\n", {"a/cpu.max": "400000 100000\n", "a/b/cpu.max": "800000 100000\n"}, 4),
        # the group's name outside its container, inside which it is the root
        ("0::/docker/f00\n", {"cpu.max": "300000 100000\n"}, 3),
        ("0::/../..\n", {"cpu.max": "300000 100000\n"}, 3),
        ("3:cpuset:/\n2:cpu:/\n", {"cpu/cpu.cfs_quota_us": "500000\n", "cpu/cpu.cfs_period_us": "100000\n"}, 5),
        ("2:cpu:/\n", {"cpu/cpu.cfs_quota_us": "-1\n", "cpu/cpu.cfs_period_us": "100000\n"}, MACHINE),
        (
            "4:cpu,cpuacct:/slurm/job\n0::/\n",
            {"cpu,cpuacct/slurm/cpu.cfs_quota_us": "600000", "cpu,cpuacct/slurm/cpu.cfs_period_us": "100000"},
            6,
        ),
    ],
)
def test_quotas_of_control_groups(tmp_path: Path, membership: str, files: dict[str, str], count: int) -> None:
    confine(tmp_path, membership, files)
    assert cores() == count


def test_the_fewest_counts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    confine(tmp_path, "0::/\n", {"cpu.max": "300000 100000\n"})
    monkeypatch.setenv("SLURM_CPUS_PER_TASK", "64")
    assert cores() == 3


@pytest.mark.skipif(sys.platform != "linux", reason="taskset is of Linux")
def test_taskset_leaves_one_worker() -> None:
    code = (
        "from graspfn.params import Compute; from graspfn.workflow.pools import pool;"
        "print(pool(Compute(None, 0, 'cpu', 60.0, 0)).size())"
    )
    done = subprocess.run(
        ["taskset", "-c", str(min(ALLOWED)), sys.executable, "-c", code], capture_output=True, text=True
    )
    assert done.stdout == "1\n", done.stderr
