"""Electronics: keyboard, monitor."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from graspfn.selection.primitives import box, disc, outline, rectangle, slab, unite


def keyboard(rng: np.random.Generator) -> Manifold:
    """A wedge of a case with rows of keys, with or without a number pad."""
    width, depth = rng.uniform(0.65, 1.0), rng.uniform(0.26, 0.38)
    front, back = rng.uniform(0.035, 0.05), rng.uniform(0.05, 0.08)
    side = outline([(-depth / 2, 0), (depth / 2, 0), (depth / 2, back), (-depth / 2, front)])
    case = slab(side, width).rotate((90, 0, 90)).translate((-width / 2, 0, 0))
    rows, columns = int(rng.integers(4, 6)), int(rng.integers(8, 12))
    pitch_x, pitch_y = (width - 0.06) / columns, (depth - 0.06) / rows
    slope = (back - front) / depth
    pad = columns - 3 if rng.random() < 0.5 else None
    keys = []
    for row in range(rows):
        y = (row - (rows - 1) / 2) * pitch_y
        z = (front + back) / 2 + slope * y
        for column in range(columns):
            x = (column - (columns - 1) / 2) * pitch_x
            wide = pitch_x * (0.5 if pad == column + 1 else 0.72)
            if row == 0 and 2 <= column <= 5:  # the space bar is one key
                if column > 2:
                    continue
                x, wide = x + 1.5 * pitch_x, 3.72 * pitch_x
            keys.append(box((wide, 0.72 * pitch_y, 0.05), (x, y, z)))
    return unite([case, *keys])


def monitor(rng: np.random.Generator) -> Manifold:
    """A flat screen on a neck and a foot."""
    width, height = rng.uniform(0.8, 1.0), rng.uniform(0.48, 0.68)
    depth, lift = rng.uniform(0.06, 0.09), rng.uniform(0.1, 0.2)
    screen = box((width, depth, height), (0, 0, lift + height / 2))
    recess = box((width - 0.09, 0.03, height - 0.09), (0, -depth / 2, lift + height / 2))
    bulge = box((0.5 * width, 0.1, 0.5 * height), (0, depth / 2 + 0.02, lift + height / 2))
    neck = box((rng.uniform(0.06, 0.18), 0.05, lift + 0.1), (0, depth / 2 - 0.005, (lift + 0.1) / 2))
    radius = rng.uniform(0.15, 0.22)
    foot = disc(radius, 0.04) if rng.random() < 0.5 else slab(rectangle(0.45, 0.25, 0.03), 0.04)
    return unite([screen - recess, bulge, neck, foot])
