"""Parts of houses, and a tent for one: curtain, door, mantel, stairs, tent."""

from __future__ import annotations

import numpy as np
from manifold3d import CrossSection, Manifold

from graspfn.selection.primitives import SEGMENTS, ball, box, disc, outline, rectangle, rod, slab, unite

CANVAS = 0.042  # thickness of a tent's walls


def curtain(rng: np.random.Generator) -> Manifold:
    """One cloth or a pair in folds from a pole or a pelmet, hanging free or tied back."""
    width, thick, drop = rng.uniform(0.55, 1.0), rng.uniform(0.045, 0.055), rng.uniform(0.7, 1.0)
    pair = rng.random() < 0.5
    drawn = rng.uniform(0.3, 0.49) * width if pair else rng.uniform(0.7, 0.95) * width
    section = _folds(rng, drawn, thick)
    cloth = slab(section, drop)
    if rng.random() < 0.4:  # tied back
        tie, waist = rng.uniform(0.3, 0.5) * drop, rng.uniform(0.6, 0.8)
        cloth = slab(section, tie, scale_top=(waist, 1)) + slab(
            section.scale((waist, 1)), drop - tie, (0, 0, tie), (1 / waist, 1)
        )
        cloth += slab(rectangle(waist * drawn + 0.03, 0.15, 0.05), 0.05, (0, 0, tie - 0.025))
    parts = [cloth.translate((x, 0, 0)) for x in ((drawn - width) / 2, (width - drawn) / 2)] if pair else [cloth]
    if rng.random() < 0.3:
        return unite([*parts, box((width + 0.04, 0.17, rng.uniform(0.08, 0.14)), (0, 0, drop))])
    ends = [(side * (width / 2 + 0.04), 0, drop) for side in (-1, 1)]
    knob = rng.uniform(0.04, 0.06)
    return unite([*parts, rod(ends, 0.03), *(ball((knob, knob, knob), end, 8) for end in ends)])


def _folds(rng: np.random.Generator, width: float, thick: float) -> CrossSection:
    """A wave along x: cloth seen from above."""
    waves = max(2, round(width / rng.uniform(0.12, 0.22)))
    x = np.linspace(-width / 2, width / 2, 6 * waves + 1)
    phase, deep = 2 * np.pi * waves * (x / width + 0.5), rng.uniform(0.025, 0.045)
    y, slope = deep * np.sin(phase), deep * np.cos(phase) * 2 * np.pi * waves / width
    normal = np.column_stack([-slope, np.ones_like(x)]) / np.hypot(slope, 1)[:, None] * thick / 2
    middle = np.column_stack([x, y])
    return outline(np.vstack([middle - normal, (middle + normal)[::-1]]))


def door(rng: np.random.Generator) -> Manifold:
    """One leaf or two, panelled, glazed, of planks or plain, with handles; some in a frame, some round above."""
    leaves = 2 if rng.random() < 0.25 else 1
    width, thick = rng.uniform(0.36, 0.48), rng.uniform(0.065, 0.085)
    parts = [_leaf(rng, width, thick)]
    at, kind = (width / 2 - 0.05, 0.0, rng.uniform(0.44, 0.52)), rng.choice(["knob", "lever", "bar"])
    for side in (-1, 1):
        y = side * (thick / 2 + 0.035)
        if kind == "knob":
            parts.append(rod([at, (at[0], y, at[2])], 0.022, 6) + ball((0.032, 0.03, 0.032), (at[0], y, at[2]), 8))
        elif kind == "lever":
            parts.append(rod([at, (at[0], y, at[2]), (at[0] - 0.1, y, at[2])], 0.022, 6))
        else:
            ends = [(at[0], y * end, at[2] + z) for end, z in ((0, -0.1), (1, -0.1), (1, 0.1), (0, 0.1))]
            parts.append(rod(ends, 0.022, 6))
    leaf = unite(parts).translate((-width / 2, 0, 0))
    whole = leaf if leaves == 1 else leaf + leaf.mirror((1, 0, 0)).translate((-0.005, 0, 0))
    if rng.random() < 0.5:
        jamb, deep = rng.uniform(0.05, 0.08), thick + rng.uniform(0.03, 0.08)
        wide = leaves * width
        middle = 0.0 if leaves == 2 else -width / 2
        hole = box((wide - 0.01, deep + 0.1, 2.0), (middle, 0, 0))
        whole += box((wide + 2 * jamb, deep, 1.0 + jamb), (middle, 0, (1 + jamb) / 2)) - hole
    return whole


def _leaf(rng: np.random.Generator, width: float, thick: float) -> Manifold:
    """The board of a door, x from -width / 2, z from 0 to 1."""
    leaf = box((width, thick, 1.0), (0, 0, 0.5))
    kind = rng.choice(["panels", "panes", "planks", "plain"])
    if kind == "planks":
        grooves = np.linspace(-width / 2, width / 2, int(rng.integers(4, 7)))[1:-1]
        leaf -= unite([box((0.02, 0.03, 3), (x, side * thick / 2, 0)) for x in grooves for side in (-1, 1)])
        braces = [box((width - 0.04, 0.05, 0.07), (0, thick / 2, z)) for z in (0.15, 0.85)]
        return unite([leaf, *braces])
    if kind == "plain":
        return leaf + box((width - 0.02, thick + 0.03, rng.uniform(0.08, 0.2)), (0, 0, 0.12))
    columns, rows = int(rng.integers(1, 3)), int(rng.integers(1, 5))
    low = rng.uniform(0.06, 0.12) if kind == "panels" else rng.uniform(0.06, 0.5)
    rise, pitch = (0.93 - low) / rows, (width - 0.1) / columns
    deep = 0.03 if kind == "panels" else 3.0
    for row in range(rows):
        for column in range(columns):
            x, z = (column - (columns - 1) / 2) * pitch, low + (row + 0.5) * rise
            size = (pitch - 0.04, deep, rise - 0.045)
            leaf -= box(size, (x, thick / 2, z)) + box(size, (x, -thick / 2, z))
    return leaf


def mantel(rng: np.random.Generator) -> Manifold:
    """A shelf on two pillars around a hearth, with or without a chimney breast."""
    height, depth = rng.uniform(0.7, 0.95), rng.uniform(0.16, 0.28)
    pillar, lintel, shelf = rng.uniform(0.11, 0.18), rng.uniform(0.12, 0.24), rng.uniform(0.045, 0.07)
    opening = 0.9 - 2 * pillar
    hole = outline(
        [(-opening / 2, -0.1), (opening / 2, -0.1), (opening / 2, height - lintel), (-opening / 2, height - lintel)]
    )
    if rng.random() < 0.3:  # arched
        spring = height - lintel - 0.35 * opening
        arch = CrossSection.circle(opening / 2, SEGMENTS).scale((1, 0.7)).translate((0, spring))
        hole = rectangle(opening, 2 * spring) + arch
    behind = slab(hole, 2.0).rotate((90, 0, 0)).translate((0, 1.0, 0))
    parts = [box((0.9, depth, height), (0, 0, height / 2)) - behind]
    if rng.random() < 0.6:  # closed behind
        parts.append(box((0.88, 0.05, height - 0.02), (0, depth / 2 - 0.025, height / 2)))
    parts.append(box((1.0, depth + 0.1, shelf), (0, -0.05, height)))
    if rng.random() < 0.6:
        parts.append(box((0.95, depth + 0.05, 0.05), (0, -0.025, height - shelf)))
    front, kind = -depth / 2, rng.choice(["plain", "round", "blocks"])
    for x in (-(0.9 - pillar) / 2, (0.9 - pillar) / 2):
        if kind == "round":
            parts.append(disc(0.42 * pillar, height, (x, front, 0)))
        if kind != "plain":
            for z, tall in ((0.06, 0.12), (height - lintel * 0.5, 0.1)):
                parts.append(box((pillar + 0.02, 0.12, tall), (x, front, z)))
    if rng.random() < 0.5:
        parts.append(box((1.0, depth + rng.uniform(0.15, 0.3), 0.05), (0, -0.06, 0.0)))
    if rng.random() < 0.3:
        breast = rng.uniform(0.25, 0.5)
        parts.append(box((rng.uniform(0.5, 0.85), 0.75 * depth, breast), (0, 0.125 * depth, height + breast / 2)))
    return unite(parts)


def stairs(rng: np.random.Generator) -> Manifold:
    """A straight flight, solid or on stringers, with or without rails; two flights about a landing; or a spiral."""
    steps, kind = int(rng.integers(4, 10)), rng.choice(["solid", "open", "landing", "spiral"])
    if kind == "spiral":
        return _spiral(rng, steps + 4, rng.uniform(0.85, 1.1) / (steps + 4))
    run, width = rng.uniform(0.7, 1.0) / steps * (0.6 if kind == "landing" else 1), rng.uniform(0.3, 0.5)
    rise = rng.uniform(0.65, 1.0) * run
    parts = [_treads(steps, rise, run, width) if kind == "open" else _flight(steps, rise, run, width)]
    for y in (0.03 - width / 2, width / 2 - 0.03):
        if rng.random() < 0.5:
            parts += _rail(steps, rise, run, y, rng.uniform(0.2, 0.28))
    if kind == "landing":
        more, top, x = int(rng.integers(2, steps)), steps * rise, steps * run + width / 2
        parts.append(box((width + 0.01, width, top), (x, 0, top / 2)))
        second = _flight(more, rise, run, width, below=top).rotate((0, 0, 90))
        parts.append(second.translate((x, width / 2 - 0.005, top)))
    return unite(parts)


def _flight(steps: int, rise: float, run: float, width: float, below: float = 0) -> Manifold:
    """Solid steps that climb towards +x from the origin, on a block that reaches so far `below` it."""
    corners = [(run * (k + over), rise * (k + 1)) for k in reversed(range(steps)) for over in (1, 0)]
    side = outline([(0, -below), (steps * run, -below), *corners])
    return slab(side, width).rotate((90, 0, 0)).translate((0, width / 2, 0))


def _treads(steps: int, rise: float, run: float, width: float) -> Manifold:
    """Boards that climb towards +x between two beams."""
    treads = [box((run + 0.03, width, 0.05), (run * (k + 0.5), 0, rise * (k + 1) - 0.025)) for k in range(steps)]
    end, top = steps * run, steps * rise
    beam = slab(outline([(0, 0), (0.9 * run, 0), (end, top - 0.9 * rise), (end, top), (0, rise)]), 0.05)
    beams = [beam.rotate((90, 0, 0)).translate((0, y, 0)) for y in (0.08 - width / 2, width / 2 - 0.03)]
    return unite([*treads, *beams])


def _rail(steps: int, rise: float, run: float, y: float, up: float) -> list[Manifold]:
    """Balusters on the first and last steps and between, under a rail."""
    feet = [(x, y, rise * (x / run + 0.5)) for x in run * np.linspace(0.5, steps - 0.5, 4)]
    posts = [rod([(x, y, z - 0.06), (x, y, z + up)], 0.026, 6) for x, y, z in feet]
    return [*posts, rod([(x, y, z + up) for x, y, z in (feet[0], feet[-1])], 0.028, 6)]


def _spiral(rng: np.random.Generator, steps: int, rise: float) -> Manifold:
    """Treads about a column, with balusters under a rail on some."""
    reach, turn, rail = rng.uniform(0.32, 0.45), rng.uniform(26, 36), rng.random() < 0.6
    tread = slab(outline([(0, -0.03), (reach, -0.12), (reach, 0.12), (0, 0.03)]), 0.045)
    parts = [disc(rng.uniform(0.04, 0.06), steps * rise + 0.2)]
    feet = []
    for k in range(steps):
        angle, z = turn * k, rise * (k + 0.6)
        parts.append(tread.rotate((0, 0, angle)).translate((0, 0, z)))
        feet.append((0.94 * reach * np.cos(np.radians(angle)), 0.94 * reach * np.sin(np.radians(angle)), z + 0.02))
    if rail:
        parts += [rod([(x, y, z), (x, y, z + 0.2)], 0.022, 6) for x, y, z in feet]
        parts.append(rod([(x, y, z + 0.2) for x, y, z in feet], 0.026, 6))
    return unite(parts)


def tent(rng: np.random.Generator) -> Manifold:
    """A ridge tent, a dome, a tipi or a pavilion, hollow and open at the front."""
    height, width, depth = rng.uniform(0.35, 0.7), rng.uniform(0.55, 0.95), rng.uniform(0.6, 1.0)
    kind = rng.choice(["ridge", "dome", "tipi", "pavilion"])
    if kind == "pavilion":
        return _pavilion(rng, width, depth, height)
    gap = rng.uniform(0.12, 0.2)
    flap = slab(outline([(-gap, -0.1), (gap, -0.1), (0, 0.8 * height)]), 1.0).rotate((90, 0, 0))  # towards -y
    if kind == "ridge":
        half, eaves = width / 2, float(rng.choice([0.0, rng.uniform(0.08, 0.18)]))
        side = outline([(-half, 0), (half, 0), (0.94 * half, eaves), (0, height), (-0.94 * half, eaves)])
        outer = slab(side, depth).rotate((90, 0, 0)).translate((0, depth / 2, 0))
        inner = slab(side.offset(-CANVAS), depth - 2 * CANVAS).rotate((90, 0, 0))
        pole = rod([(0, 0, height - 0.1), (0, 0, height + 0.06)], 0.026, 6)
        poles = [pole.translate((0, y, 0)) for y in (0.04 - depth / 2, depth / 2 - 0.04)]
        return unite([outer - inner.translate((0, depth / 2 - CANVAS, -CANVAS)) - flap, *poles])
    if kind == "dome":
        radii = np.array([width / 2, depth / 2, height])
        return ball(radii, sides=20) - box((3, 3, 1), (0, 0, -0.5)) - ball(radii - CANVAS, sides=20) - flap
    sides, radius = int(rng.choice([5, 6, 8, 12])), rng.uniform(0.33, 0.46)
    cone = Manifold.cylinder(1.0, radius, 0.05, sides)
    inner = Manifold.cylinder(1.0, radius - CANVAS, 0.01, sides).translate((0, 0, -0.06))
    ends = [(-0.03, 0.01), (0.03, 0.03), (0.01, -0.04)]
    poles = [rod([(x, y, 0.9), (-3 * x, -3 * y, 1.1)], 0.024, 6) for x, y in ends]
    return unite([cone - inner - flap, *poles])


def _pavilion(rng: np.random.Generator, width: float, depth: float, height: float) -> Manifold:
    """A hipped roof on four posts, closed behind or not."""
    post, ridge, low = rng.uniform(0.35, 0.55), rng.uniform(0.05, 0.6) * width, rng.uniform(0.06, 0.13)
    eaves, x, y = box((width, depth, 0.05), (0, 0, post)), width / 2 - 0.03, depth / 2 - 0.03
    roof = Manifold.batch_hull([eaves, box((ridge, 0.05, 0.02), (0, 0, post + 0.55 * height))])
    valance = box((width, depth, low), (0, 0, post - low / 2 + 0.02))
    room = box((width - 2 * CANVAS, depth - 2 * CANVAS, 1), (0, 0, post - 0.5))
    attic = roof.scale((0.88, 0.88, 1)).translate((0, 0, -0.07))
    posts = [box((0.05, 0.05, post), (a, b, post / 2)) for a in (-x, x) for b in (-y, y)]
    if rng.random() < 0.4:
        posts.append(box((2 * x, CANVAS, post), (0, y, post / 2)))
    return unite([roof + valance - room - attic, *posts])
