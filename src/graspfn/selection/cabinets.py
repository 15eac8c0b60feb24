"""Furniture with shelves, doors and drawers, their fronts towards -y: bookshelf, desk, dresser and their kin."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from graspfn.selection.furniture import legs
from graspfn.selection.primitives import ball, box, outline, rectangle, slab, unite

WALL = 0.042  # of boards that stand alone


def _carcass(rng: np.random.Generator, width: float, depth: float, height: float) -> tuple[list[Manifold], float]:
    """A box about x = y = 0 on a plinth or on feet, under an overhanging top on some; and the level of its floor."""
    low = rng.uniform(0.05, 0.13)
    parts = [box((width, depth, height - low), (0, 0, (height + low) / 2))]
    if rng.random() < 0.4:
        parts.append(box((width - 0.05, depth - 0.05, low + 0.01), (0, 0, low / 2)))
    else:
        parts += legs(rng, width / 2 - 0.05, depth / 2 - 0.05, low + 0.03, 0)
    if rng.random() < 0.6:
        over = rng.uniform(0.03, 0.08)
        parts.append(slab(rectangle(width + over, depth + over, 0.015), WALL, (0, 0, height - 0.005)))
    return parts, low


def _fronts(
    rng: np.random.Generator, size: tuple[float, float], grid: tuple[int, int], front: float, low: float, kind: str
) -> list[Manifold]:
    """Doors or drawers, in a grid of (columns, rows) over a size of (x, z), raised from the face y = front above
    z = low, each with a handle."""
    columns, rows = grid
    width, height = size[0] / columns, size[1] / rows
    knobs, reach = rng.random() < 0.5, rng.uniform(0.3, 0.6)
    parts = []
    for column in range(columns):
        side = 1 if column < columns / 2 else -1  # doors open in pairs
        for row in range(rows):
            x, z = (column - (columns - 1) / 2) * width, low + (row + 0.5) * height
            parts.append(box((width - 0.03, 0.05, height - 0.03), (x, front, z)))
            at = (x + side * (width / 2 - 0.055), front - 0.035, z) if kind == "doors" else (x, front - 0.035, z)
            long = reach * (height if kind == "doors" else width)
            bar = (0.03, 0.05, long) if kind == "doors" else (long, 0.05, 0.03)
            parts.append(ball((0.026, 0.03, 0.026), at, 8) if knobs else box(bar, at))
    return parts


def _bays(size: tuple[float, float], grid: tuple[int, int], depth: float, front: float, low: float) -> list[Manifold]:
    """What to cut out of a box to leave shelves: a grid of (columns, rows) over a size of (x, z), as `_fronts`."""
    columns, rows = grid
    width, height = (size[0] - WALL) / columns, (size[1] - WALL) / rows
    return [
        box(
            (width - WALL, 2 * depth, height - WALL),
            ((column - (columns - 1) / 2) * width, front, low + WALL / 2 + (row + 0.5) * height),
        )
        for column in range(columns)
        for row in range(rows)
    ]


def bookshelf(rng: np.random.Generator) -> Manifold:
    """Shelves in one to three bays, with or without a back, some with books or with doors below."""
    width, depth = rng.uniform(0.4, 1.0), rng.uniform(0.2, 0.34)
    grid = max(1, round(width / rng.uniform(0.35, 0.7))), int(rng.integers(3, 6))
    case = box((width, depth, 1.0), (0, 0, 0.5))
    back = rng.random() < 0.7
    bays = _bays((width, 1.0), grid, depth - WALL if back else 2 * depth, -depth / 2, 0)
    parts = [case - unite(bays)]
    bay, rise = (width - WALL) / grid[0], (1 - WALL) / grid[1]
    stocked = rng.random() < 0.6
    for column in range(grid[0]) if stocked else ():
        for row in range(grid[1]):
            left, floor = -width / 2 + WALL / 2 + column * bay, WALL + row * rise
            end = left + rng.uniform(0.2, 0.95) * (bay - WALL)
            while left + 0.06 < end:
                thick, tall = rng.uniform(0.04, 0.07), rng.uniform(0.5, 0.85) * (rise - WALL)
                deep = rng.uniform(0.6, 0.85) * depth
                parts.append(box((thick, deep, tall + 0.02), (left + thick / 2, (depth - deep) / 2, floor + tall / 2)))
                left += thick
    if not stocked and rng.random() < 0.4:
        parts += [box((width - 0.02, depth - 0.02, rise), (0, 0, rise / 2 + 0.02))]
        parts += _fronts(rng, (width, rise), (2 * grid[0], 1), -depth / 2, WALL / 2, "doors")
    if rng.random() < 0.4:
        parts.append(box((width + 0.05, depth + 0.04, WALL), (0, 0, 1.0)))
    return unite(parts)


def desk(rng: np.random.Generator) -> Manifold:
    """A top on drawers, panels or legs, some with a return, with shelves above, or with a raised back."""
    depth, height, thick = rng.uniform(0.42, 0.6), rng.uniform(0.45, 0.6), rng.uniform(0.04, 0.06)
    parts = [box((1.0, depth, thick), (0, 0, height))]
    wide = rng.uniform(0.22, 0.32)
    sides = [str(rng.choice(["drawers", "drawers", "panel", "legs"])), str(rng.choice(["drawers", "panel", "legs"]))]
    for side, kind in zip((-1, 1), sides, strict=True):
        if kind == "drawers":
            rows, low = int(rng.integers(2, 5)), float(rng.choice([0.0, 0.08]))
            block = [box((wide, depth - 0.05, height - low), (0, 0, (height + low) / 2))]
            block += _fronts(rng, (wide, height - low - 0.04), (1, rows), -depth / 2 + 0.025, low + 0.01, "drawers")
            if low:
                block += legs(rng, wide / 2 - 0.04, depth / 2 - 0.07, low + 0.02, 0)
            parts += [part.translate((side * (0.49 - wide / 2), 0, 0)) for part in block]
        elif kind == "panel":
            parts.append(box((0.045, depth - 0.03, height), (side * 0.46, 0, height / 2)))
        else:
            pair = legs(rng, 0, depth / 2 - 0.06, height, 0)
            parts += [leg.translate((side * 0.44, 0, 0)) for leg in pair[1:3]]
    if rng.random() < 0.5:
        low = rng.uniform(0.3, 0.7) * height
        parts.append(box((0.92, 0.045, height - low), (0, depth / 2 - 0.06, (height + low) / 2)))
    extra = rng.choice(["none", "return", "hutch"])
    if extra == "return":
        out = rng.uniform(0.25, 0.45)
        x, y = 0.5 - wide / 2, -depth / 2 - out / 2
        parts.append(box((wide, out + 0.02, thick), (x, y + 0.01, height)))
        parts.append(box((wide - 0.04, 0.045, height), (x, y - out / 2 + 0.06, height / 2)))
    elif extra == "hutch":
        up = rng.uniform(0.2, 0.4)
        shelves = box((1.0, 0.2, up)) - unite(_bays((1.0, up), (int(rng.integers(1, 4)), 1), 0.16, -0.1, -up / 2))
        parts.append(shelves.translate((0, depth / 2 - 0.1, height + up / 2)))
    return unite(parts)


def dresser(rng: np.random.Generator) -> Manifold:
    """A chest of drawers, wide or tall, some under a mirror."""
    width, depth, height = rng.uniform(0.55, 1.0), rng.uniform(0.28, 0.45), rng.uniform(0.5, 1.0)
    parts, low = _carcass(rng, width, depth, height)
    grid = 1 if width < 0.65 else int(rng.integers(2, 4)), int(rng.integers(2, 6)) if height > 0.7 else 3
    parts += _fronts(rng, (width - 0.04, height - low - 0.03), grid, -depth / 2, low + 0.015, "drawers")
    if height < 0.75 and rng.random() < 0.5:
        wide, tall = rng.uniform(0.5, 0.85) * width, rng.uniform(0.35, 0.5)
        frame = outline(rectangle(wide, tall, rng.uniform(0.01, 0.45 * min(wide, tall))).to_polygons()[0])
        mirror = slab(frame, 0.05) - slab(frame.offset(-0.04), 0.02, (0, 0, 0.035))
        y = depth / 2 - 0.06
        parts.append(mirror.rotate((90, 0, 0)).translate((0, y + 0.025, height + 0.03 + tall / 2)))
        parts.append(box((0.4 * wide, 0.05, 0.2), (0, y + 0.02, height + 0.06)))
    return unite(parts)


def night_stand(rng: np.random.Generator) -> Manifold:
    """A small cabinet: drawers, a drawer above an open bay, or a drawer and a shelf between legs."""
    width, depth, height = rng.uniform(0.6, 0.95), rng.uniform(0.5, 0.8), 0.96
    kind = rng.choice(["drawers", "open", "legs"])
    if kind == "legs":
        drop = rng.uniform(0.2, 0.35)
        parts = [box((width - 0.06, depth - 0.06, drop), (0, 0, height - drop / 2))]
        parts += legs(rng, width / 2 - 0.07, depth / 2 - 0.07, height - 0.05, float(rng.choice([0.0, 0.12])))
        parts.append(slab(rectangle(width, depth, 0.02), WALL, (0, 0, height - 0.005)))
        if rng.random() < 0.6:
            parts.append(box((width - 0.1, depth - 0.1, WALL), (0, 0, rng.uniform(0.15, 0.3))))
        return unite(parts + _fronts(rng, (width - 0.1, drop), (1, 1), 0.03 - depth / 2, height - drop, "drawers"))
    parts, low = _carcass(rng, width, depth, height)
    tall, rows = height - low, int(rng.integers(1, 4))
    if kind == "open":
        share = rng.uniform(0.4, 0.65) * tall
        parts[0] -= unite(_bays((width, share), (1, int(rng.integers(1, 3))), depth - WALL, -depth / 2, low))
        low, tall, rows = low + share, tall - share, 1
    kind = "doors" if rows == 1 and rng.random() < 0.3 else "drawers"
    return unite(parts + _fronts(rng, (width - 0.04, tall - 0.03), (1, rows), -depth / 2, low + 0.01, kind))


def tv_stand(rng: np.random.Generator) -> Manifold:
    """A low wide cabinet of open bays between doors or drawers, some with the set on it."""
    height, depth = rng.uniform(0.25, 0.45), rng.uniform(0.24, 0.36)
    parts, low = _carcass(rng, 1.0, depth, height)
    side, tall = rng.uniform(0.2, 0.33), height - low
    middle = 1.0 - 2 * side
    open_grid = (int(rng.integers(1, 3)), int(rng.integers(1, 3)) if tall > 0.25 else 1)
    parts[0] -= unite(_bays((middle, tall), open_grid, depth - WALL, -depth / 2, low))
    for x in (-1, 1):
        kind = rng.choice(["doors", "drawers", "open"])
        if kind == "open":
            bays = _bays((side, tall), (1, int(rng.integers(1, 3)) if tall > 0.2 else 1), depth - WALL, -depth / 2, low)
            parts[0] -= unite(bays).translate((x * (1.0 - side) / 2, 0, 0))
        else:
            rows = 1 if kind == "doors" else 2
            fronts = _fronts(rng, (side - 0.02, tall - 0.02), (1, rows), -depth / 2, low + 0.01, str(kind))
            parts += [part.translate((x * (1.0 - side) / 2, 0, 0)) for part in fronts]
    if rng.random() < 0.35:
        wide, up = rng.uniform(0.6, 0.95), rng.uniform(0.36, 0.52)
        screen = box((wide, 0.06, up)) - box((wide - 0.08, 0.04, up - 0.08), (0, -0.03, 0))
        parts.append(screen.translate((0, 0, height + up / 2 + 0.06)))
        parts.append(box((0.3, 0.05, 0.15), (0, 0.01, height + 0.06)) + box((0.45, 0.16, 0.05), (0, 0, height + 0.05)))
    return unite(parts)


def wardrobe(rng: np.random.Generator) -> Manifold:
    """A tall cupboard of two to four doors, some with drawers below, open shelves or a cornice."""
    width, depth = rng.uniform(0.45, 0.85), rng.uniform(0.24, 0.38)
    parts, low = _carcass(rng, width, depth, 0.97)
    doors = 2 if width < 0.6 else int(rng.integers(2, 5))
    top = 0.96
    if rng.random() < 0.4:
        drawers = rng.uniform(0.12, 0.3)
        grid = max(1, doors // 2), 1 if drawers < 0.2 else 2
        parts += _fronts(rng, (width - 0.03, drawers), grid, -depth / 2, low + 0.01, "drawers")
        low += drawers
    if rng.random() < 0.3:  # one bay without a door
        bay = width / doors
        shelves = unite(_bays((bay, top - low), (1, int(rng.integers(3, 5))), depth - WALL, -depth / 2, low))
        parts[0] -= shelves.translate(((width - bay) / 2, 0, 0))
        shift, doors, width = -bay / 2, doors - 1, width - bay
    else:
        shift = 0.0
    fronts = _fronts(rng, (width - 0.03, top - low - 0.02), (doors, 1), -depth / 2, low + 0.01, "doors")
    return unite(parts + [part.translate((shift, 0, 0)) for part in fronts])
