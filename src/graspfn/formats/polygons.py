"""Triangles out of the faces of a file, which may have any number of corners and need not be convex."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from manifold3d import triangulate


def triangles(vertices: np.ndarray, polygons: Sequence[Sequence[int] | np.ndarray] | np.ndarray) -> np.ndarray:
    """(m, 3) int64: the corners of every polygon's triangles, in the order of the polygons; of a triangle its own.

    vertices: (n, 3); those of a polygon about in one plane. What has fewer than three corners is no face.
    ValueError where a polygon names a vertex that is not there.
    """
    sizes = np.fromiter(map(len, polygons), np.int64, len(polygons))
    if isinstance(polygons, np.ndarray):  # all of one size
        corners = polygons.astype(np.int64).ravel()
    else:
        corners = np.fromiter(itertools.chain.from_iterable(polygons), np.int64, sizes.sum())
    if len(corners) and (corners.min() < 0 or corners.max() >= len(vertices)):
        raise ValueError("out of range: a face names a vertex that is not there")
    starts = np.cumsum(sizes) - sizes
    counts = np.maximum(sizes - 2, 0)
    first = np.cumsum(counts) - counts  # of the triangles of each polygon
    found = np.empty((counts.sum(), 3), dtype=np.int64)
    for size in np.unique(sizes[sizes > 2]):
        some = np.flatnonzero(sizes == size)
        rings = corners[starts[some, None] + np.arange(size)]
        fan = np.column_stack([np.zeros(size - 2, dtype=np.int64), np.arange(1, size - 1), np.arange(2, size)])
        found[first[some, None] + np.arange(size - 2)] = rings[:, fan]
        if size > 3:
            for k, flat in _concave(vertices[rings]):
                found[first[some[k]] + np.arange(size - 2)] = rings[k][triangulate([flat])]
    return found


def _concave(rings: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """Which of the polygons (p, k, 3) a fan from their first corner would fold, and their corners (k, 2) as they lie
    in their plane, counter-clockwise."""
    with np.errstate(all="ignore"):  # corners that are no numbers are turned down later
        rings = rings - rings[:, :1]
        rings = rings / np.abs(rings).max(axis=(1, 2), keepdims=True)
        ahead = np.roll(rings, -1, axis=1)
        normals = np.cross(rings, ahead).sum(axis=1)
        turns = np.einsum("pkd,pd->pk", np.cross(rings[:, 1:-1], rings[:, 2:]), normals)
        bends = np.flatnonzero((turns < 0).any(axis=1) & np.isfinite(rings).all(axis=(1, 2)))
    flat = []
    for k in bends:
        across = np.linalg.svd(normals[k][None])[2][1:]  # two directions in the plane
        if np.linalg.det([*across, normals[k]]) < 0:
            across = across[::-1]
        flat.append((int(k), rings[k] @ across.T))
    return flat
