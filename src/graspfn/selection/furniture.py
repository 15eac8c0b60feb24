"""Furniture on legs: bench, chair, stool, table."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from graspfn.selection.primitives import box, disc, rectangle, ring, rod, slab, unite


def legs(rng: np.random.Generator, x: float, y: float, height: float, splay: float, count: int = 4) -> list[Manifold]:
    """Legs under the rim of a seat or top of half size (x, y), reaching `splay` further out at the floor."""
    radius = rng.uniform(0.024, 0.036)
    if count == 4:
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * [x, y]
    else:
        angle = np.arange(count) * 2 * np.pi / count
        corners = np.column_stack([x * np.cos(angle), y * np.sin(angle)])
    if splay == 0 and rng.random() < 0.5:
        return [box((2 * radius, 2 * radius, height), (a, b, height / 2)) for a, b in corners]
    feet = corners * (1 + splay)
    return [rod([(*foot, radius), (*top, height - radius)], radius) for foot, top in zip(feet, corners, strict=True)]


def chair(rng: np.random.Generator) -> Manifold:
    """Four legs or a swivel foot, a seat, a panelled or slatted back, arms on some."""
    width, depth, height = rng.uniform(0.36, 0.55), rng.uniform(0.36, 0.52), rng.uniform(0.34, 0.5)
    thick = rng.uniform(0.04, 0.09)
    parts = [slab(rectangle(width, depth, rng.uniform(0.01, 0.06)), thick, (0, 0, height))]
    x, y = width / 2 - 0.05, depth / 2 - 0.05
    if rng.random() < 0.25:
        parts.append(disc(0.035, height))
        for k in range(5):
            parts.append(rod([(0, 0, 0.07), (0.24, 0, 0.03)], 0.03).rotate((0, 0, 72 * k)))
    else:
        parts += legs(rng, x, y, height + thick / 2, float(rng.choice([0.0, 0.15])))
    top, lean = 1.0 - rng.uniform(0, 0.15), rng.uniform(0.0, 0.1)
    back: list[Manifold] = []
    if rng.random() < 0.5:
        back.append(box((width - 0.02, 0.045, top - height), (0, 0, (top - height) / 2)))
    else:
        posts = np.linspace(-x, x, int(rng.integers(2, 5)))
        back += [box((0.045, 0.045, top - height), (a, 0, (top - height) / 2)) for a in posts]
        back.append(box((width - 0.02, 0.045, 0.1), (0, 0, top - height - 0.05)))
    parts += [part.rotate((-np.degrees(lean), 0, 0)).translate((0, y + 0.01, height)) for part in back]
    if rng.random() < 0.35:
        for side in (-1, 1):
            a, z = side * (width / 2 - 0.02), height + rng.uniform(0.18, 0.22)
            parts.append(rod([(a, -y, height + 0.02), (a, -y, z), (a, y + 0.02, z)], 0.026, 6))
    return unite(parts)


def stool(rng: np.random.Generator) -> Manifold:
    """A seat on three or four legs, braced by a ring, or on one column."""
    radius, thick = rng.uniform(0.17, 0.26), rng.uniform(0.045, 0.09)
    height = rng.uniform(0.45, 0.9)
    if rng.random() < 0.25:
        column = [disc(0.04, height), disc(radius * 0.9, 0.045)]
        return unite([*column, disc(radius, thick, (0, 0, height - 0.01))])
    count, splay = int(rng.integers(3, 5)), float(rng.choice([0.15, 0.4]))
    reach = 0.72 * radius / (np.sqrt(2) if count == 4 else 1)
    parts = [disc(radius, thick, (0, 0, height - 0.01)), *legs(rng, reach, reach, height + 0.01, splay, count)]
    if rng.random() < 0.6:
        level = rng.uniform(0.25, 0.45)
        parts.append(ring(0.72 * radius * (1 + splay * (1 - level)), 0.022, (0, 0, level * height)))
    return unite(parts)


def table(rng: np.random.Generator) -> Manifold:
    """A top on four legs, on a column, or on two side panels with a shelf."""
    width, depth, height = 1.0, rng.uniform(0.5, 0.9), rng.uniform(0.35, 0.7)
    thick = rng.uniform(0.036, 0.06)
    kind = rng.choice(["legs", "column", "panels"])
    if kind == "column":
        foot = disc(0.25, 0.045)
        if rng.random() < 0.5:
            foot = box((0.5, 0.07, 0.05), (0, 0, 0.025)) + box((0.07, 0.5, 0.05), (0, 0, 0.025))
        top = disc(0.5, thick, (0, 0, height)).scale((1, rng.uniform(0.7, 1.0), 1))
        return unite([top, foot, disc(rng.uniform(0.04, 0.07), height + 0.01)])
    parts = [slab(rectangle(width, depth, rng.uniform(0.005, 0.1)), thick, (0, 0, height))]
    if kind == "legs":
        splay = float(rng.choice([0.0, 0.0, 0.12]))
        parts += legs(rng, 0.43, depth / 2 - 0.08, height + thick / 2, splay)
        if splay == 0 and rng.random() < 0.4:
            parts.append(box((0.88, depth - 0.14, 0.036), (0, 0, rng.uniform(0.15, 0.4) * height)))
    else:
        parts += [box((0.045, depth - 0.06, height + 0.01), (x, 0, height / 2)) for x in (-0.42, 0.42)]
        parts.append(box((0.85, depth - 0.1, 0.04), (0, 0, rng.uniform(0.2, 0.6) * height)))
    return unite(parts)


def bench(rng: np.random.Generator) -> Manifold:
    """A plank or slats on legs, end panels or trestles; a back with arms on some."""
    depth, height, thick = rng.uniform(0.26, 0.38), rng.uniform(0.26, 0.42), rng.uniform(0.045, 0.07)
    slats = int(rng.integers(1, 5))
    pitch = depth / slats
    plank = box((1.0, pitch - (0.025 if slats > 1 else 0), thick))
    rows = (np.arange(slats) - (slats - 1) / 2) * pitch
    parts = [plank.translate((0, y, height)) for y in rows]
    kind = rng.choice(["legs", "panels", "trestles"])
    for x in rng.uniform(0.36, 0.45) * np.array([-1, 1]):
        parts.append(box((0.06, depth - 0.02, 0.05), (x, 0, height - thick / 2)))
        if kind == "panels":
            parts.append(box((0.06, depth - 0.06, height), (x, 0, height / 2)))
        elif kind == "trestles":
            parts.append(box((0.07, 0.08, height), (x, 0, height / 2)) + box((0.08, depth, 0.05), (x, 0, 0.025)))
        else:
            parts += [leg.translate((x, 0, 0)) for leg in legs(rng, 0, depth / 2 - 0.05, height, 0.15, 4)[1:3]]
        if kind != "legs" and slats > 1:
            parts.append(box((0.9, 0.04, 0.06), (0, 0, rng.uniform(0.3, 0.6) * height)))
    return unite(parts) if rng.random() < 0.5 else unite(parts + _bench_back(rng, depth / 2 - 0.03, height))


def _bench_back(rng: np.random.Generator, y: float, height: float) -> list[Manifold]:
    """Posts behind a bench's seat that carry rails, with arms on some."""
    top, posts = rng.uniform(0.3, 0.4), int(rng.integers(2, 5))
    back = [box((0.055, 0.05, top), (x, 0, top / 2)) for x in np.linspace(-0.45, 0.45, posts)]
    count = int(rng.integers(1, 4))
    wide = (top - 0.06) / count
    back += [box((1.0, 0.06, wide - 0.03), (0, -0.01, top - (k + 0.5) * wide)) for k in range(count)]
    back = [part.rotate((-rng.uniform(0, 1) - 4, 0, 0)).translate((0, y, height)) for part in back]
    if rng.random() < 0.5:
        level = height + rng.uniform(0.16, 0.22)
        for x in (-0.45, 0.45):
            back.append(rod([(x, -y + 0.02, height), (x, -y + 0.02, level), (x, y + 0.02, level)], 0.028, 6))
    return back
