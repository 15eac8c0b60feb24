"""What made a report, as provenance.json beside it: code, parameters, versions, machine, hours."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib.metadata
import os
import platform
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from graspfn.params import Params

PACKAGES = (
    "dartpy",
    "torch",
    "numpy",
    "scipy",
    "pandas",
    "trimesh",
    "embreex",
    "manifold3d",
    "matplotlib",
    "distributed",
    "mcap",
    "mcap-ros2-support",
    "safetensors",
    "dvc",
)


def run_record(params: Any, stage_seconds: Mapping[str, float], root: Path = Path()) -> dict[str, Any]:
    """params: of params.yaml, all but compute. root: of the repository. stage_seconds: of the stages that ran here; of
    others, whose results came from the cache, nothing is known.

    dvc_lock: SHA-256 of what dvc.lock says of the stages before the report, whose own lines are written after it.
    """
    sections = [field.name for field in dataclasses.fields(Params) if field.name != "compute"]
    return {
        "commit": commit(root),
        "dvc_lock": lock_digest(root / "dvc.lock"),
        "versions": dict(versions()),
        "machine": machine(),
        "hours": {stage: round(seconds / 3600, 4) for stage, seconds in stage_seconds.items()},
        "params": {name: _plain(getattr(params, name)) for name in sections},
    }


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return dataclasses.asdict(value) if dataclasses.is_dataclass(value) and not isinstance(value, type) else value


def commit(root: Path) -> dict[str, Any] | None:
    """The commit that is checked out, and whether files that git knows differ from it; None outside of git."""
    try:
        of, changed = (
            subprocess.run(["git", *command.split()], cwd=root, capture_output=True, text=True, check=True).stdout
            for command in ("rev-parse HEAD", "status --porcelain --untracked-files=no -- . :!dvc.lock :!reports")
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return {"id": of.strip(), "changed": bool(changed.strip())}


def lock_digest(path: Path) -> str | None:
    """None where there is no dvc.lock."""
    if not path.is_file():
        return None
    stages = yaml.safe_load(path.read_text(encoding="utf-8")).get("stages", {})
    before = {name: lines for name, lines in stages.items() if name != "report"}
    return hashlib.sha256(yaml.safe_dump(before).encode()).hexdigest()


def versions() -> list[tuple[str, str | None]]:
    """(package, version) of what results depend on."""
    found: list[tuple[str, str | None]] = [("Python", platform.python_version())]
    for package in PACKAGES:
        try:
            found.append((package, importlib.metadata.version(package)))
        except importlib.metadata.PackageNotFoundError:
            found.append((package, None))
    return found


def machine() -> dict[str, Any]:
    """Its name is nobody's business."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": round(memory / 2**30, 1),
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
