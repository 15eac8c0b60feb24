"""Fittings of kitchen and bathroom, their fronts towards -y: range hood, sink, toilet."""

from __future__ import annotations

import numpy as np
from manifold3d import CrossSection, Manifold

from graspfn.selection.primitives import (
    SEGMENTS,
    ball,
    box,
    cavity,
    disc,
    outline,
    profile,
    rectangle,
    revolve,
    rod,
    slab,
    unite,
)

SHELL = 0.042  # walls of basins and hoods


def range_hood(rng: np.random.Generator) -> Manifold:
    """A canopy, hollow from below, on a chimney: a pyramid, a bell, a flat box; or a slanted hood without one."""
    width, depth, kind = rng.uniform(0.7, 1.0), rng.uniform(0.4, 0.6), rng.choice(["pyramid", "bell", "box", "slanted"])
    flue, rise, lip = rng.uniform(0.2, 0.32), rng.uniform(0.15, 0.35), rng.uniform(0.06, 0.1)
    tall = lip + rise + rng.uniform(0.2, 0.5)
    if kind == "bell":
        curve = profile([0, 0.4 * rise, rise, rise + lip], [flue / 2, 0.6 * flue, 0.42 * width, 0.45 * width], 9)
        bell = (revolve(curve) - cavity(curve, SHELL)).rotate((180, 0, 0)).translate((0, 0, lip + rise))
        return bell + disc(flue / 2, tall - rise, (0, 0, lip + rise - 0.045))
    hollow = 0.6 * rise + 0.5 * lip
    if kind == "slanted":
        side = outline([(-depth, 0), (0, 0), (0, rise + lip), (-0.4 * depth, rise + lip), (-depth, lip)])
        hood = slab(side, width).rotate((90, 0, 90)).translate((-width / 2, 0, 0))
    else:
        chimney = (flue, min(flue, depth - 0.02), tall - lip + 0.01)
        hood = box((width, depth, lip), (0, -depth / 2, lip / 2))
        hood += box(chimney, (0, -chimney[1] / 2, (tall + lip - 0.01) / 2))
        if kind == "pyramid":
            hood += _frustum((width - 0.02, depth - 0.01), chimney[:2], rise).translate((0, 0, lip - 0.002))
        else:
            hollow = lip - SHELL
    room = _frustum((width - 2 * SHELL, depth - 2 * SHELL), (0.5 * flue, 0.12), hollow)
    buttons = [ball((0.026, 0.024, 0.022), (x, 0.004 - depth, lip / 2), 8) for x in (-0.08, 0.0, 0.08)]
    return unite([hood - room.translate((0, -SHELL, -1e-3)), *buttons])


def _frustum(low: tuple[float, float], high: tuple[float, float], height: float) -> Manifold:
    """A block from a rectangle (x, y) on z = 0 to another on z = height, both with their backs on y = 0."""
    return Manifold.batch_hull([box((x, y, 1e-3), (0, -y / 2, z)) for (x, y), z in ((low, 0.0), (high, height))])


def sink(rng: np.random.Generator) -> Manifold:
    """A wash basin on a pedestal, on the wall or let into a cabinet; or a kitchen sink."""
    kind = rng.choice(["pedestal", "wall", "vanity", "kitchen"])
    if kind == "kitchen":
        return _kitchen_sink(rng)
    width, depth, deep = rng.uniform(0.55, 0.9), rng.uniform(0.42, 0.55), rng.uniform(0.16, 0.26)
    hollow = ball((width / 2 - 0.07, depth / 2 - 0.1, deep - SHELL), (0, -0.035, 0), 24)
    tap = _tap(rng).translate((0, depth / 2 - 0.065, -0.01))
    if kind == "vanity":
        tall = rng.uniform(0.4, 0.65)
        body = [box((width, depth, tall), (0, 0, -tall / 2)), box((width + 0.05, depth + 0.03, 0.05), (0, 0, -0.02))]
        for x in (-width / 4, width / 4):
            body.append(box((width / 2 - 0.04, 0.06, tall - 0.14), (x, -depth / 2, -tall / 2 - 0.02)))
            body.append(ball((0.026, 0.03, 0.026), (0.3 * x, -depth / 2 - 0.035, -0.4 * tall), 8))
        return unite(body) - hollow + tap
    plan = rectangle(width, depth, rng.uniform(0.05, 0.45 * depth))
    shell = slab(plan, deep, scale_top=(1.7, 1.6)).scale((0.6, 0.63, 1)).translate((0, 0, -deep))
    body = [shell, slab(plan, 0.05, (0, 0, -0.05))]
    if kind == "pedestal":
        tall, waist = rng.uniform(0.55, 0.8), rng.uniform(0.07, 0.1)
        heights = [-tall, -0.85 * tall, -0.5 * tall, -0.6 * deep]
        body.append(revolve(profile(heights, [1.7 * waist, 1.2 * waist, waist, 1.5 * waist], 8)))
    else:
        trap = [(0, 0, 0.02), (0, 0, -0.16), (0, 0.09, -0.2), (0, 0.14, -0.1), (0, depth / 2, -0.1)]
        body.append(rod(np.array(trap) - [0, 0, deep], 0.035))
        body.append(box((0.8 * width, 0.05, deep + 0.16), (0, depth / 2 - 0.02, -deep / 2 - 0.08)))
    return unite(body) - hollow + tap


def _kitchen_sink(rng: np.random.Generator) -> Manifold:
    """One or two square bowls let into a plate, beside a drainer on some."""
    depth, deep, bowls = rng.uniform(0.45, 0.6), rng.uniform(0.16, 0.26), int(rng.integers(1, 3))
    drainer = bowls == 1 or rng.random() < 0.5
    wide, long = (0.56 if drainer else 0.94) / bowls, depth - 0.12
    tub = slab(rectangle(wide, long, 0.06), deep)
    hollow = slab(rectangle(wide - 2 * SHELL, long - 2 * SHELL, 0.06), deep + 0.1, (0, 0, SHELL))
    places = [(-0.47 + (k + 0.5) * wide, -0.04, -deep) for k in range(bowls)]
    basin = unite([box((1.0, depth, 0.05)), *(tub.translate(place) for place in places)])
    basin -= unite([hollow.translate(place) for place in places])
    if drainer:
        basin -= unite([box((0.03, depth - 0.16, 0.04), (x, -0.03, 0.03)) for x in np.linspace(0.17, 0.43, 4)])
    return basin + _tap(rng).translate((float(np.mean(places, axis=0)[0]), depth / 2 - 0.06, 0.01))


def _tap(rng: np.random.Generator) -> Manifold:
    """A spout from the origin that bends towards -y, between two handles or with a lever."""
    up, out = rng.uniform(0.14, 0.26), rng.uniform(0.07, 0.1)
    turn = np.linspace(0, np.pi * rng.uniform(0.6, 0.95), 5)
    bend = np.column_stack([0 * turn, -out * (1 - np.cos(turn)), up + out * np.sin(turn)])
    parts = [rod([(0, 0, 0), *bend], 0.026, 6), disc(0.04, 0.04)]
    if rng.random() < 0.5:
        for x in (-0.13, 0.13):
            parts += [disc(0.028, 0.07, (x, 0, 0)), ball((0.045, 0.045, 0.026), (x, 0, 0.075), 8)]
    else:
        parts.append(rod([(0, 0, 0.08), (0.1, 0, 0.12)], 0.024, 6))
    return unite(parts)


def toilet(rng: np.random.Generator) -> Manifold:
    """An oval bowl with a seat before a cistern, its lid up, down or missing."""
    half, long, rim = rng.uniform(0.2, 0.25), rng.uniform(0.26, 0.33), rng.uniform(0.36, 0.46)
    oval, lid = CrossSection.circle(1.0, SEGMENTS).scale((half, long)), rng.choice(["up", "down", "none"])
    if rng.random() < 0.4:  # squarer behind
        oval += rectangle(2 * half - 0.06, long).translate((0, long / 2))
    foot, back = rng.uniform(0.45, 0.75), long + rng.uniform(0.02, 0.06)
    base = slab(oval.scale((foot, foot)), 0.06, (0, 0.3 * (1 - foot) * long, 0))
    body = [Manifold.batch_hull([slab(oval, 0.08, (0, 0, rim - 0.08)), base])]
    body.append(box((1.7 * foot * half, long, rim - 0.04), (0, back - long / 2, rim / 2 - 0.02)))
    seat = oval.scale((1.06, 1.04))
    if lid == "down":
        body.append(slab(seat, 0.07, (0, 0, rim - 0.005), (0.94, 0.95)))
    else:
        body.append(slab(seat, 0.045, (0, 0, rim - 0.005)))
        body = [unite(body) - ball((half - 0.05, long - 0.06, rim - 0.1), (0, -0.02, rim + 0.045), 20)]
    if lid == "up":
        flap = slab(oval.scale((1.0, 0.95)), 0.045).rotate((rng.uniform(-85, -80), 0, 0))
        body.append(flap.translate((0, back - 0.08, rim + 0.92 * long)))
    wide, deep, tall = rng.uniform(0.36, 0.5), rng.uniform(0.16, 0.22), rng.uniform(0.3, 0.42)
    tank = [slab(rectangle(wide, deep, 0.03), tall, (0, 0, -0.05), (1.06, 1.1))]
    tank.append(slab(rectangle(1.06 * wide + 0.04, 1.1 * deep + 0.03, 0.03), 0.05, (0, 0, tall - 0.06)))
    if lid == "up" or rng.random() < 0.5:
        tank.append(disc(0.045, 0.035, (0, 0, tall - 0.02)))
    else:
        x, y, z = 0.07 - wide / 2, -deep / 2 - 0.03, tall - 0.13
        tank.append(rod([(x, 0, z), (x, y, z), (x + 0.1, y, z - 0.01)], 0.024, 6))
    return unite(body + [part.translate((0, back + deep / 2 - 0.05, rim)) for part in tank])
