"""Electronics: keyboard, laptop, monitor, radio, games console (xbox)."""

from __future__ import annotations

import numpy as np
from manifold3d import CrossSection, Manifold

from graspfn.selection.primitives import SEGMENTS, ball, box, disc, outline, rectangle, rod, slab, unite


def keyboard(rng: np.random.Generator) -> Manifold:
    """A wedge of a case with rows of keys, with or without a number pad."""
    width, depth = rng.uniform(0.65, 1.0), rng.uniform(0.26, 0.45)
    front, back = rng.uniform(0.035, 0.06), rng.uniform(0.05, 0.14)
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


def laptop(rng: np.random.Generator) -> Manifold:
    """A base with keys and a pad, and the screen at some angle to it."""
    width, depth = rng.uniform(0.85, 1.0), rng.uniform(0.56, 0.72)
    base, lid = rng.uniform(0.05, 0.07), rng.uniform(0.055, 0.065)
    plate = rectangle(width, depth, rng.uniform(0.01, 0.06))
    pad = box((rng.uniform(0.2, 0.32) * width, 0.24 * depth, 0.03), (0, -0.31 * depth, base))
    parts = [slab(plate, base) - pad]
    rows, columns = int(rng.integers(3, 5)), int(rng.integers(5, 9))
    wide, deep = (width - 0.12) / columns, 0.5 * depth / rows
    for row in range(rows):
        for column in range(columns):
            at = ((column - (columns - 1) / 2) * wide, 0.4 * depth - (row + 0.5) * deep, base)
            parts.append(box((wide - 0.022, deep - 0.022, 0.04), at))
    shut = slab(plate, lid) - box((width - 0.1, depth - 0.1, 0.03))  # face down
    hinge = (0, depth / 2 - 0.02, base + 0.004)
    parts.append(shut.translate((0, -depth / 2, 0)).rotate((-rng.uniform(75, 140), 0, 0)).translate(hinge))
    parts += [disc(0.034, 0.16).rotate((0, 90, 0)).translate((x * width - 0.08, *hinge[1:])) for x in (-0.3, 0.3)]
    return unite(parts)


def radio(rng: np.random.Generator) -> Manifold:
    """Square with a handle or an aerial, arched, or a boombox of two loudspeakers."""
    kind, depth = rng.choice(["square", "arched", "boombox"]), rng.uniform(0.16, 0.3)
    wide, tall = rng.uniform(0.7, 0.95), rng.uniform(0.38, 0.62)
    if kind == "arched":
        wide, tall = tall + 0.1, wide
    radius = rng.uniform(0.26, 0.38) * min(tall, wide)
    if kind == "arched":
        arch = CrossSection.circle(wide / 2, SEGMENTS).translate((0, tall / 2 - wide / 2))
        section = rectangle(wide, tall - wide / 2).translate((0, -wide / 4)) + arch
        speakers, knobs = [(0.0, 0.62 * tall)], [(-0.15, 0.15), (0.15, 0.15)]
    elif kind == "square":
        section, at = rectangle(wide, tall, rng.uniform(0.01, 0.12)), wide / 2 - 0.12
        speakers, knobs = [(radius + 0.04 - wide / 2, 0.5 * tall)], [(at, 0.7 * tall), (at, 0.3 * tall)]
    else:
        section, at = rectangle(wide, tall, 0.03), wide / 2 - radius - 0.03
        speakers, knobs = [(-at, 0.46 * tall), (at, 0.46 * tall)], [(0.0, 0.3 * tall)]
    parts = [slab(section, depth).rotate((90, 0, 0)).translate((0, depth / 2, tall / 2))]
    rim = disc(radius, 0.06) - disc(radius - 0.04, 0.06, (0, 0, 0.025)) + disc(0.4 * radius, 0.06)
    size = rng.uniform(0.035, 0.06)
    dial = disc(size, 0.07, top_radius=0.8 * size)
    for part, places in ((rim, speakers), (dial, knobs)):
        parts += [part.rotate((90, 0, 0)).translate((x, 0.03 - depth / 2, z)) for x, z in places]
    if kind == "arched":
        return unite([*parts, box((wide + 0.06, depth + 0.06, 0.05), (0, 0, 0.025))])
    parts += [box((0.05, 0.06, 0.04), (x, 0, tall)) for x in np.linspace(-0.12, 0.12, 4)]
    x, z = wide / 2 - 0.06, tall + rng.uniform(0.1, 0.16)
    if kind == "boombox" or rng.random() < 0.5:
        parts.append(rod([(-x, 0, tall - 0.02), (-x, 0, z), (x, 0, z), (x, 0, tall - 0.02)], 0.026, 6))
    else:
        tip = (rng.uniform(-0.3, 0.7), depth / 4, tall + rng.uniform(0.25, 0.5))
        parts.append(rod([(x, depth / 4, tall - 0.03), tip], 0.024, 6))
    return unite(parts)


def xbox(rng: np.random.Generator) -> Manifold:
    """A games console, lying or on end: flat, waisted, with a crossed lid, or a tower; or its controller."""
    kind = rng.choice(["flat", "waisted", "crossed", "tower", "controller"])
    if kind == "controller":
        return _controller(rng)
    wide, deep, tall = rng.uniform(0.85, 1.0), rng.uniform(0.65, 0.9), rng.uniform(0.2, 0.3)
    if kind == "tower":
        wide, deep, tall = rng.uniform(0.4, 0.55), rng.uniform(0.4, 0.55), 1.0
    section = rectangle(wide, deep, rng.uniform(0.01, 0.06))
    if kind == "waisted":
        bite = CrossSection.circle(2.0, 96)
        section -= bite.translate((0, deep / 2 + 1.96)) + bite.translate((0, -deep / 2 - 1.96))
    body = slab(section, tall)
    if kind == "tower":
        grid = np.linspace(-0.12, 0.12, 3)
        body -= unite([disc(0.034, 0.05, (x, y, tall - 0.03)) for x in grid for y in grid])
    elif kind == "crossed":
        across = float(np.degrees(np.arctan2(deep, wide)))
        cross = [box((1.6, 0.12, 0.1), (0, 0, tall)).rotate((0, 0, turn)) for turn in (-across, across)]
        body += (unite(cross) ^ slab(section, tall + 0.1)) + disc(0.14, 0.07, (0, 0, tall - 0.01))
    else:
        vent = (0.03, rng.uniform(0.3, 0.6) * deep, 0.05)
        body -= unite([box(vent, (x, 0, tall)) for x in wide * np.linspace(0.1, 0.42, 5)])
    level = 0.62 * min(tall, 0.4)
    body -= box((0.5 * wide, 0.09 if kind == "waisted" else 0.06, 0.035), (-0.1 * wide, -deep / 2, level))
    body += disc(0.05, 0.07).rotate((90, 0, 0)).translate((0.3 * wide, 0.05 - deep / 2, level))
    if kind == "tower" or rng.random() < 0.6:
        return body
    upright = body.rotate((0, 90, 0)).translate((-tall / 2, 0, wide / 2))
    return upright + slab(rectangle(tall + 0.14, 0.5 * deep, 0.03), 0.05, (0, 0, -0.035))


def _controller(rng: np.random.Generator) -> Manifold:
    """Two grips, two sticks, a cross and four buttons, its back towards -y."""
    half, grip, drop = rng.uniform(0.26, 0.32), rng.uniform(0.1, 0.13), rng.uniform(0.3, 0.42)
    parts = [Manifold.batch_hull([ball((0.17, 0.17, 0.09), (x, 0, 0)) for x in (-half, half)])]
    for side in (-1, 1):
        parts.append(rod([(side * half, 0, 0), (side * (half + 0.1), -drop, -0.04)], [0.13, grip], 10))
        parts.append(box((0.2, 0.1, 0.07), (side * half, 0.15, 0.01)))
    for x, y in ((-half, 0.03), (0.16, -0.09)):
        parts.append(disc(0.035, 0.16, (x, y, 0)) + disc(0.055, 0.045, (x, y, 0.13)))
    turn = np.arange(4) * np.pi / 2
    parts += [disc(0.03, 0.13, (half + 0.07 * np.cos(a), 0.03 + 0.07 * np.sin(a), 0)) for a in turn]
    return unite([*parts, *(box(size, (-0.14, -0.09, 0.09)) for size in ((0.15, 0.045, 0.06), (0.045, 0.15, 0.06)))])
