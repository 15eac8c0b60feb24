"""Plants in their pots: flower pot, plant."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from graspfn.selection.primitives import ball, cavity, disc, outline, rectangle, revolve, rod, slab, unite


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


def plant(rng: np.random.Generator) -> Manifold:
    """A house plant in a full pot: a palm, a tree in balls, a cactus or upright blades."""
    tall, foot = rng.uniform(0.18, 0.34), rng.uniform(0.1, 0.16)
    mouth = foot * rng.uniform(1.0, 1.5)
    pot = disc(foot, tall, top_radius=mouth)
    if rng.random() < 0.3:
        pot = slab(rectangle(2 * foot, 2 * foot, 0.02), tall, scale_top=(mouth / foot, mouth / foot))
    parts = [pot, disc(0.8 * mouth, 0.03, (0, 0, tall - 0.01))]
    kind = rng.choice(["palm", "tree", "cactus", "blades"])
    grow = {"palm": _palm, "tree": _tree, "cactus": _cactus, "blades": _blades}[str(kind)]
    return unite([*parts, *(part.translate((0, 0, tall - 0.02)) for part in grow(rng, mouth))])


def _palm(rng: np.random.Generator, _: float) -> list[Manifold]:
    trunk, count = rng.uniform(0.1, 0.45), int(rng.integers(5, 9))
    parts = [rod([(0, 0, 0), (0, 0, trunk)], [0.045, 0.035])]
    for k in range(count):
        out, up = rng.uniform(0.25, 0.38), rng.uniform(0.08, 0.3)
        path = [(0, 0, 0), (0.4 * out, 0, up), (0.8 * out, 0, 0.85 * up), (1.05 * out, 0, 0.4 * up)]
        frond = rod(path, [0.024, 0.026, 0.026, 0.02], 6).scale((1, 1.8, 1))
        parts.append(frond.rotate((0, 0, 360 * k / count + rng.uniform(-12, 12))).translate((0, 0, trunk)))
    return parts


def _tree(rng: np.random.Generator, _: float) -> list[Manifold]:
    trunk = rng.uniform(0.2, 0.4)
    parts = [rod([(0, 0, 0), (rng.uniform(-0.05, 0.05), 0, trunk / 2), (0, 0, trunk + 0.1)], 0.034)]
    if rng.random() < 0.4:  # cut into balls one above the other
        z = trunk
        for radius in sorted(rng.uniform(0.09, 0.2, int(rng.integers(1, 4))), reverse=True):
            parts.append(ball((radius, radius, radius), (0, 0, z + 0.85 * radius), 12))
            z += 1.65 * radius
        return parts
    for angle in rng.uniform(0, 6) + np.arange(int(rng.integers(4, 8))) * 2.4:
        out, radii = rng.uniform(0.06, 0.13), rng.uniform(0.09, 0.16, 3)
        place = (out * np.cos(angle), out * np.sin(angle), trunk + rng.uniform(0.1, 0.28))
        parts += [ball(radii, place, 10), rod([(0, 0, trunk), place], 0.022, 6)]
    return parts


def _cactus(rng: np.random.Generator, mouth: float) -> list[Manifold]:
    ribs, radius, tall = int(rng.integers(7, 12)), rng.uniform(0.45, 0.75) * mouth, rng.uniform(0.25, 0.7)
    angle = np.arange(2 * ribs) * np.pi / ribs
    star = outline(np.column_stack([np.cos(angle), np.sin(angle)]) * np.tile([1.0, 0.78], ribs)[:, None] * radius)
    parts = [slab(star, tall), slab(star, 0.4 * radius, (0, 0, tall), (0.6, 0.6))]
    for k in range(int(rng.integers(0, 4)) if tall > 0.4 else 0):
        out, low, up = radius + rng.uniform(0.06, 0.12), rng.uniform(0.3, 0.6) * tall, rng.uniform(0.1, 0.25)
        arm = rod([(0, 0, low), (out, 0, low + 0.02), (out, 0, low + up)], rng.uniform(0.035, 0.05))
        parts.append(arm.rotate((0, 0, 120 * k + rng.uniform(-25, 25))))
    return parts


def _blades(rng: np.random.Generator, mouth: float) -> list[Manifold]:
    parts = []
    for k in range(int(rng.integers(5, 10))):
        tall, wide, lean = rng.uniform(0.3, 0.65), rng.uniform(0.04, 0.06), rng.uniform(0, 20)
        blade = rod([(0, 0, 0), (0, 0, 0.55 * tall), (0, 0, tall)], [0.7 * wide, wide, 0.024], 6).scale((0.6, 1, 1))
        place = rng.uniform(0.1, 0.5) * mouth
        parts.append(blade.rotate((0, lean, 0)).translate((place, 0, 0)).rotate((0, 0, 137.5 * k)))
    return parts
