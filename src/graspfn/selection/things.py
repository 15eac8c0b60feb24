"""Things of no other kind: hammer."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from graspfn.selection.primitives import ball, box, disc, outline, rod, slab, unite


def hammer(rng: np.random.Generator) -> Manifold:
    """Handle along x; the head a claw, a ball or cross peen, or a mallet's block."""
    grip = rng.uniform(0.032, 0.05)
    handle = rod([(0, 0, 0), (0.3, 0, 0), (0.45, 0, 0), (1, 0, 0)], [grip, grip * 1.1, grip * 0.75, grip * 0.75])
    handle = handle.scale((1, 1, rng.uniform(0.7, 1.0)))
    kind = rng.choice(["claw", "ball", "cross", "mallet"])
    if kind == "mallet":
        radius, half = rng.uniform(0.09, 0.14), rng.uniform(0.16, 0.24)
        block = disc(radius, 2 * half)
        if rng.random() < 0.5:
            block = box((2 * radius, 1.6 * radius, 2 * half), (0, 0, half))
        return handle + block.rotate((90, 0, 0)).translate((0.94, half, 0))
    face, reach = rng.uniform(0.055, 0.075), rng.uniform(0.14, 0.2)
    poll = disc(face * 0.75, reach).rotate((90, 0, 0)) + disc(face, 0.05).rotate((90, 0, 0)).translate((0, -reach, 0))
    cheek = box((0.11, 0.12, 0.1))
    if kind == "claw":
        peen = _claw(rng.uniform(0.2, 0.28))
    elif kind == "ball":
        peen = rod([(0, 0, 0), (0, 0.13, 0)], 0.04) + ball((face, face, face), (0, 0.16, 0))
    else:
        wedge = outline([(-0.05, 0), (0.05, 0), (0.018, reach), (-0.018, reach)])
        peen = slab(wedge, 0.1, (0, 0, -0.05))
    return handle + unite([poll, cheek, peen]).translate((0.95, 0, 0))


def _claw(reach: float) -> Manifold:
    """Two prongs that curve back towards the grip."""
    turn = np.linspace(0, np.pi / 3, 5)
    y, x = reach * np.sin(turn) / np.sin(np.pi / 3), -0.5 * reach * (1 - np.cos(turn))
    parts = []
    for side in (-1, 1):
        spread = side * np.linspace(0.015, 0.045, 5)
        parts.append(rod(np.column_stack([x, y, spread]), np.linspace(0.036, 0.02, 5), 6))
    return unite(parts)
