"""Random generators that depend on what is drawn for, never on which worker draws or in which order."""

from __future__ import annotations

import hashlib

import numpy as np


def seed_of(*names: int | float | str) -> int:
    """A 64-bit seed for a path of names, e.g. seed_of(0, "label", "procedural-cup-0003")."""
    text = "\x1f".join(str(name) for name in names)
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "big")


def generator(*names: int | float | str) -> np.random.Generator:
    """The generator of a path of names; equal paths give equal draws everywhere."""
    return np.random.default_rng(seed_of(*names))
