"""Vehicles: airplane, car."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from graspfn.selection.primitives import ball, box, disc, outline, profile, revolve, slab, unite


def airplane(rng: np.random.Generator) -> Manifold:
    """Nose towards +x, with swept wings, a tail and, on some, engines."""
    radius, thick = rng.uniform(0.045, 0.075), rng.uniform(0.034, 0.042)
    hull = revolve(profile([0, 0.25, 0.8, 0.93, 1], [0.025, radius, radius, 0.7 * radius, 0.012], samples=12), 16)
    parts = [hull.rotate((0, 90, 0))]
    span, sweep, chord = rng.uniform(0.3, 0.5), rng.uniform(0.0, 0.25), rng.uniform(0.14, 0.22)
    root = rng.uniform(0.5, 0.62)
    z = -rng.choice([0.4, 0.0, -0.4]) * radius
    parts.append(_wings(root, span, sweep, chord, thick).translate((0, 0, z)))
    parts.append(_wings(0.14, 0.4 * span, 0.4 * sweep, 0.5 * chord, thick))
    height = rng.uniform(0.12, 0.2)
    fin = outline([(0.02, 0), (0.17, 0), (0.08, height), (0.0, height)])
    parts.append(slab(fin, thick).rotate((90, 0, 0)).translate((0, thick / 2, 0.4 * radius)))
    for k in range(int(rng.integers(0, 3))):
        along = span * (0.35 + 0.28 * k)
        x = root - sweep * along / span + 0.02
        for y in (-along, along):
            parts.append(disc(0.035, 0.13).rotate((0, 90, 0)).translate((x - 0.07, y, z - 0.035)))
    return unite(parts)


def _wings(root: float, span: float, sweep: float, chord: float, thick: float) -> Manifold:
    """A pair of wings with their leading edge at x = root on the axis."""
    tip = 0.45 * chord
    right = [(root - chord, 0.0), (root, 0.0), (root - sweep, span), (root - sweep - tip, span)]
    left = [(x, -y) for x, y in reversed(right)]
    return slab(outline(right) + outline(left), thick, (0, 0, -thick / 2))


def car(rng: np.random.Generator) -> Manifold:
    """Nose towards +x: a saloon, hatchback, van or pickup, some with a rack, a spoiler or a spare wheel."""
    width, belt, wheel = rng.uniform(0.36, 0.44), rng.uniform(0.17, 0.22), rng.uniform(0.075, 0.095)
    kind, extra = rng.choice(["saloon", "hatchback", "van", "pickup"]), rng.choice(["none", "rack", "tail"])
    rear, front, roof_rear, roof_front = {  # where the cabin meets the body, and the ends of its roof
        "saloon": (-0.34, 0.22, -0.2, 0.06),
        "hatchback": (-0.48, 0.22, -0.4, 0.06),
        "van": (-0.495, 0.38, -0.48, 0.24),
        "pickup": (-0.08, 0.24, -0.06, 0.1),
    }[str(kind)]
    middle, roof = (roof_rear + roof_front) / 2, belt + rng.uniform(0.1, 0.14) + (0.07 if kind == "van" else 0)
    floor, bonnet = 0.6 * wheel, belt - rng.uniform(0.0, 0.05)
    side = [(-0.5, floor), (0.5, floor), (0.5, 0.8 * bonnet), (0.47, bonnet), (front, belt), (-0.5, belt)]
    body = slab(outline(side, 0.015), width).rotate((90, 0, 0)).translate((0, width / 2, 0))
    if kind == "pickup":
        body -= box((0.37, width - 0.14, 0.2), (-0.275, 0, belt + 0.04))
    lower = box((front - rear, width - 0.01, 0.01), ((front + rear) / 2, 0, belt - 0.02))
    upper = box((roof_front - roof_rear, rng.uniform(0.74, 0.9) * width, 0.01), (middle, 0, roof))
    wheels, arches = _wheels(width, wheel, rng.uniform(0.27, 0.31))
    parts = [body - arches, Manifold.batch_hull([lower, upper]), wheels]
    parts += [ball((0.026, 0.035, 0.026), (front - 0.04, y, belt + 0.02), 4) for y in (-width / 2, width / 2)]
    if extra == "rack":
        parts += [box((roof_front - roof_rear - 0.02, 0.03, 0.05), (middle, y, roof + 0.015)) for y in (-0.1, 0.1)]
    elif extra == "tail" and kind == "saloon":
        parts.append(box((0.06, width - 0.06, 0.03), (-0.46, 0, belt + 0.045)))
        parts += [box((0.04, 0.04, 0.07), (-0.46, y, belt + 0.01)) for y in (-0.1, 0.1)]
    elif extra == "tail" and kind != "pickup":
        parts.append(disc(0.08, 0.06).rotate((0, 90, 0)).translate((-0.54, 0, belt - 0.02)))
    return unite(parts)


def _wheels(width: float, radius: float, axle: float) -> tuple[Manifold, Manifold]:
    """Four wheels at x = +-axle, and what their arches cut out of a body of that width."""
    tyre = Manifold.cylinder(0.085, radius, 0.9 * radius, 16).translate((0, 0, width / 2 - 0.07))
    arch = Manifold.cylinder(0.1, 1.25 * radius, 1.25 * radius, 12).translate((0, 0, width / 2 - 0.05))
    wheels, arches = (
        unite([part.rotate((turn, 0, 0)).translate((x, 0, radius)) for x in (-axle, axle) for turn in (-90, 90)])
        for part in (tyre, arch)
    )
    return wheels, arches
