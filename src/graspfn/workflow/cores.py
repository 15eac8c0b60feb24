"""How many processor cores this process may use, which on a shared machine are fewer than it has."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

CGROUPS, MEMBERSHIP = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")
# What Slurm granted on this node; without them the affinity says it only where Slurm confines jobs to their cores.
GRANTS = ("SLURM_CPUS_PER_TASK", "SLURM_CPUS_ON_NODE")


def cores() -> int:
    """The fewest that the machine, the affinity (`taskset`), CPU quotas (containers) and a Slurm job leave.

    Of joblib's and Dask's own counts neither asks Slurm, nor a quota that a folder above the process's own sets.
    """
    counts = [os.cpu_count() or 1]
    if hasattr(os, "sched_getaffinity"):  # not on macOS
        counts.append(len(os.sched_getaffinity(0)))
    counts += [math.ceil(quota) for quota in _quotas()]
    granted = next((os.environ[name] for name in GRANTS if name in os.environ), "")
    if granted.isdecimal():
        counts.append(int(granted))
    return max(1, min(counts))


def _quotas() -> Iterator[float]:
    """Cores' worth of time that the control groups of this process (cgroup v1 and v2) and those above them get."""
    try:
        lines = MEMBERSHIP.read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, group = line.split(":", 2)
        if not controllers:  # v2
            roots = [CGROUPS]
        elif "cpu" in controllers.split(","):
            roots = [CGROUPS / controllers, CGROUPS / "cpu"]
        else:
            continue
        for root in roots:
            own = root / group.strip("/")
            # A container may see the name that its group has outside, and the group itself as the root.
            for folder in (own, *own.parents[: len(own.parts) - len(root.parts)]):
                quota, period = _v1(folder) if controllers else _v2(folder)
                if quota > 0 and period > 0:
                    yield quota / period


def _v1(folder: Path) -> tuple[int, int]:
    return _integer(folder / "cpu.cfs_quota_us"), _integer(folder / "cpu.cfs_period_us")


def _v2(folder: Path) -> tuple[int, int]:
    try:
        quota, period = (folder / "cpu.max").read_text().split()
        return int(quota), int(period)
    except (OSError, ValueError):  # no limit: "max 100000"
        return -1, -1


def _integer(path: Path) -> int:
    try:
        return int(path.read_text())
    except (OSError, ValueError):
        return -1
