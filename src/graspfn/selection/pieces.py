"""The pieces that a mesh falls into."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


def connected(pairs: np.ndarray, count: int) -> np.ndarray:
    """(count,) int: which piece each of `count` things is in; pairs (n, 2): which of them hang together."""
    return connected_components(coo_array((np.ones(len(pairs)), tuple(pairs.T)), (count, count)), False)[1]


def boxes(piece: np.ndarray, low: np.ndarray, high: np.ndarray | None = None) -> np.ndarray:
    """(2, p, 3) lowest and highest corner of the box around each piece; low, high (n, 3) of the parts it is made of."""
    high = low if high is None else high
    shape = (piece.max() + 1, 3)
    around = np.stack([np.full(shape, np.inf), np.full(shape, -np.inf)])
    np.minimum.at(around[0], piece, low)
    np.maximum.at(around[1], piece, high)
    return around
