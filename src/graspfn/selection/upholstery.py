"""Upholstered furniture: bed, sofa."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from graspfn.selection.primitives import ball, box, disc, outline, rectangle, rod, slab, unite


def bed(rng: np.random.Generator) -> Manifold:
    """A mattress with pillows in a frame, single or double, with a headboard and sometimes a footboard; or a bunk."""
    width, legs = rng.uniform(0.45, 0.95), rng.uniform(0.06, 0.14)
    frame, mattress = rng.uniform(0.06, 0.1), rng.uniform(0.08, 0.14)
    lying = [box((width, 1.0, frame), (0, 0, legs + frame / 2))]
    lying.append(slab(rectangle(width - 0.04, 0.95, 0.05), mattress + 0.02, (0, 0, legs + frame - 0.02)))
    top = legs + frame + mattress
    pillows = 1 if width < 0.65 else 2
    for k in range(pillows):
        x = (k - (pillows - 1) / 2) * 0.46 * width
        lying.append(ball((min(0.19, 0.42 * width / pillows), 0.11, 0.06), (x, 0.33, top + 0.01), 12))
    if rng.random() < 0.4:  # a blanket folded over the foot
        lying.append(box((width - 0.01, rng.uniform(0.2, 0.5), mattress), (0, -0.2, top - mattress / 2 + 0.03)))
    posts = [(x, y) for x in (-width / 2 + 0.03, width / 2 - 0.03) for y in (-0.47, 0.47)]
    if width < 0.65 and rng.random() < 0.35:  # a bunk
        rise = rng.uniform(0.42, 0.55)
        tall = rise + top + 0.08
        ladder = [box((0.06, 0.04, tall), (width / 2 - 0.01, y, tall / 2)) for y in (-0.3, -0.08)]
        ladder += [box((0.05, 0.24, 0.04), (width / 2 - 0.01, -0.19, z)) for z in np.linspace(0.15, tall - 0.1, 4)]
        return unite([*lying, *(part.translate((0, 0, rise)) for part in lying), *ladder, *_posts(posts, tall)])
    if rng.random() < 0.3:  # down to the floor
        lying.append(box((width - 0.06, 0.92, legs + 0.02), (0, 0, legs / 2)))
    head = top + rng.uniform(0.12, 0.35)
    lying.append(_board(rng, width, head).translate((0, 0.49, 0)))
    if rng.random() < 0.5:
        lying.append(_board(rng, width, rng.uniform(0.5, 0.9) * head).translate((0, -0.49, 0)))
    return unite([*lying, *_posts(posts, legs + 0.03)])


def _posts(places: list[tuple[float, float]], height: float) -> list[Manifold]:
    return [box((0.06, 0.06, height), (x, y, height / 2)) for x, y in places]


def _board(rng: np.random.Generator, width: float, height: float) -> Manifold:
    """The end of a bed: a panel, straight or arched, or bars between posts."""
    half, kind = width / 2 + 0.01, rng.choice(["panel", "arch", "bars"])
    if kind == "panel":
        return box((2 * half, 0.05, height), (0, 0, height / 2))
    if kind == "arch":
        turn = np.linspace(0, np.pi, 13)
        arch = np.column_stack([half * np.cos(turn), 0.75 * height + 0.25 * height * np.sin(turn)])
        return slab(outline([(-half, 0), (half, 0), *arch]), 0.05).rotate((90, 0, 0)).translate((0, 0.025, 0))
    bars = [
        box((0.04, 0.04, height), (x, 0, height / 2))
        for x in np.linspace(-half + 0.02, half - 0.02, int(rng.integers(4, 7)))
    ]
    knobs = [ball((0.045, 0.045, 0.045), (x, 0, height), 6) for x in (-half + 0.03, half - 0.03)]
    rails = [box((2 * half, 0.05, 0.06), (0, 0, z)) for z in (0.17, height - 0.05)]
    return unite([*bars, *knobs, *rails])


def sofa(rng: np.random.Generator) -> Manifold:
    """Two to four cushions between arms, square or rolled; some with a chaise, some on legs."""
    cushions = int(rng.integers(1, 5))
    width, depth = 0.28 + 0.18 * cushions, rng.uniform(0.36, 0.48)
    feet, seat = float(rng.choice([0.0, rng.uniform(0.05, 0.09)])), rng.uniform(0.16, 0.22)
    arm, arm_height = rng.uniform(0.06, 0.12), seat + rng.uniform(0.05, 0.13)
    back, thick = seat + rng.uniform(0.14, 0.26), rng.uniform(0.09, 0.13)
    inner = width - 2 * arm
    pitch = inner / cushions
    parts = [box((width - 0.01, depth, seat - feet - 0.05), (0, 0, (seat + feet - 0.05) / 2))]
    parts.append(box((width - 0.02, thick, back - feet), (0, (depth - thick) / 2, (back + feet) / 2)))
    lean, plump = rng.uniform(6, 14), rng.uniform(0.06, 0.09)
    pad = slab(rectangle(pitch - 0.02, depth - 0.02, 0.03), 0.07, (0, -0.02, seat - 0.06))
    pillow = slab(rectangle(pitch - 0.02, back - seat, 0.03), plump).rotate((90 - lean, 0, 0))
    for x in (np.arange(cushions) - (cushions - 1) / 2) * pitch:
        parts += [pad.translate((x, 0, 0)), pillow.translate((x, depth / 2 - thick + 0.01, (seat + back) / 2))]
    chaise = int(rng.choice([-1, 1])) if cushions > 2 and rng.random() < 0.4 else 0
    if chaise:
        x, out = chaise * (inner - pitch) / 2, rng.uniform(0.2, 0.35)
        parts.append(box((pitch, out + 0.1, seat - feet), (x, -depth / 2 - out / 2 + 0.05, (seat + feet) / 2)))
    rolled = rng.random() < 0.4
    for side in (-1, 1):
        x = side * (width - arm) / 2
        parts.append(box((arm, depth, arm_height - feet), (x, 0, (arm_height + feet) / 2)))
        if rolled:
            roll = disc(arm * 0.65, depth + 0.02).rotate((90, 0, 0))
            parts.append(roll.translate((x + side * 0.01, depth / 2 + 0.01, arm_height)))
    if feet:
        for x in (-width / 2 + 0.05, width / 2 - 0.05):
            parts += [rod([(x, y, 0.025), (x, y, feet + 0.03)], 0.026, 6) for y in (0.05 - depth / 2, depth / 2 - 0.05)]
    return unite(parts)
