"""Per-object results of long stages, kept in an ignored scratch folder so that a killed stage goes on where it was.

A shard is named after a hash of everything its content depends on: the object's files, the parameters and the code of
the rooms that compute it. A changed input makes another name, so a shard is never stale.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

SCRATCH = Path(".scratch")


def _plain(value: Any) -> Any:
    return dataclasses.asdict(value) if dataclasses.is_dataclass(value) and not isinstance(value, type) else str(value)


def _content(part: Any) -> bytes:
    if isinstance(part, Path):
        return part.read_bytes()
    if isinstance(part, np.ndarray):
        return f"{part.dtype.str} {part.shape} ".encode() + np.ascontiguousarray(part).tobytes()
    return json.dumps(part, default=_plain, sort_keys=True).encode()


def code_digest(*rooms: str) -> str:
    """Hash of the Python files of `graspfn` rooms, or of single modules ("seeds.py")."""
    root = Path(__file__).parents[1]
    digest = hashlib.blake2b(digest_size=16)
    for room in sorted(rooms):
        for path in [root / room] if room.endswith(".py") else sorted((root / room).rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def shard_key(*parts: Any) -> str:
    """Hash of plain values, dataclasses, arrays and files (Paths, by content)."""
    digest = hashlib.blake2b(digest_size=16)
    for part in parts:
        content = _content(part)
        digest.update(len(content).to_bytes(8, "big") + content)
    return digest.hexdigest()


def shard_path(stage: str, key: str) -> Path:
    """Where the shard of `key` lies: .scratch/<stage>/<key>.npz."""
    return SCRATCH / stage / f"{key}.npz"


def sweep(stage: str, keep: Iterable[Path]) -> None:
    """Delete the stage's shards that the run just finished did not use."""
    used = set(keep)
    for path in (SCRATCH / stage).glob("*"):
        if path not in used:
            path.unlink()
