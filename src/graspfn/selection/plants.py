"""Plants in their pots: flower pot."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from graspfn.selection.primitives import ball, cavity, disc, revolve, rod, unite


def flower_pot(rng: np.random.Generator) -> Manifold:
    """A tapered pot with a rim, empty or with a plant in its soil."""
    planted = rng.random() < 0.6
    height, foot, top = rng.uniform(0.3, 0.45), rng.uniform(0.12, 0.2), rng.uniform(0.22, 0.3)
    curve = np.array([[foot, 0.0], [top, height]])
    rim = disc(top + rng.uniform(0.02, 0.04), 0.3 * height, (0, 0, 0.7 * height))
    hollow = cavity(curve, 0.04)
    if not planted:
        return revolve(curve) + rim - hollow
    soil = disc(foot - 0.02, 0.85 * height, (0, 0, 0.02), top - 0.03)
    parts = [revolve(curve) + rim - hollow, soil]
    if rng.random() < 0.4:  # a bush
        crown = rng.uniform(0.2, 0.3)
        parts.append(rod([(0, 0, 0.1), (0, 0, height + 1.2 * crown)], 0.035))
        parts.append(ball((crown, crown, rng.uniform(0.8, 1.2) * crown), (0, 0, height + 1.3 * crown), 16))
    else:
        count = rng.integers(4, 8)
        for k in range(count):
            parts.append(_leaf(rng, 360 * k / count + rng.uniform(-15, 15), 0.75 * height))
    return unite(parts)


def _leaf(rng: np.random.Generator, heading_deg: float, root: float) -> Manifold:
    """A stalk that leaves the soil and ends in one broad leaf."""
    out, up = rng.uniform(0.16, 0.3), rng.uniform(0.3, 0.6)
    stalk = rod([(0, 0, root), (out * 0.3, 0, root + 0.6 * up), (out, 0, root + up)], 0.022, 6)
    length = rng.uniform(0.09, 0.14)
    blade = ball((length, 0.6 * length, 0.026), (0, 0, 0), 12).rotate((0, rng.uniform(-60, 30), 0))
    return (stalk + blade.translate((out, 0, root + up))).rotate((0, 0, heading_deg))
