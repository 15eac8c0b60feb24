"""Vehicles: airplane."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from graspfn.selection.primitives import disc, outline, profile, revolve, slab, unite


def airplane(rng: np.random.Generator) -> Manifold:
    """Nose towards +x, with swept wings, a tail and, on some, engines."""
    radius, thick = rng.uniform(0.045, 0.075), rng.uniform(0.034, 0.042)
    hull = revolve(profile([0, 0.25, 0.8, 0.93, 1], [0.025, radius, radius, 0.7 * radius, 0.012], samples=12), 16)
    parts = [hull.rotate((0, 90, 0))]
    span, sweep, chord = rng.uniform(0.3, 0.5), rng.uniform(0.0, 0.25), rng.uniform(0.14, 0.22)
    root = rng.uniform(0.5, 0.62)
    z = -rng.choice([0.4, 0.0, -0.4]) * radius
    parts.append(_wings(root, span, sweep, chord, thick).translate((0, 0, z)))
    parts.append(_wings(0.14, 0.4 * span, 0.4 * sweep, 0.5 * chord, thick))
    height = rng.uniform(0.12, 0.2)
    fin = outline([(0.02, 0), (0.17, 0), (0.08, height), (0.0, height)])
    parts.append(slab(fin, thick).rotate((90, 0, 0)).translate((0, thick / 2, 0.4 * radius)))
    for k in range(int(rng.integers(0, 3))):
        along = span * (0.35 + 0.28 * k)
        x = root - sweep * along / span + 0.02
        for y in (-along, along):
            parts.append(disc(0.035, 0.13).rotate((0, 90, 0)).translate((x - 0.07, y, z - 0.035)))
    return unite(parts)


def _wings(root: float, span: float, sweep: float, chord: float, thick: float) -> Manifold:
    """A pair of wings with their leading edge at x = root on the axis."""
    tip = 0.45 * chord
    right = [(root - chord, 0.0), (root, 0.0), (root - sweep, span), (root - sweep - tip, span)]
    left = [(x, -y) for x, y in reversed(right)]
    return slab(outline(right) + outline(left), thick, (0, 0, -thick / 2))
