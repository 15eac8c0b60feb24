"""Household objects turned about an axis, and the bathtub: bottle, bowl, dish, cup, vase, lamp, cone."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from graspfn.selection.primitives import (
    ball,
    box,
    cavity,
    disc,
    outline,
    profile,
    rectangle,
    revolve,
    ring,
    rod,
    slab,
    unite,
)


def bottle(rng: np.random.Generator) -> Manifold:
    """Closed by a cap, or open with a hollow inside."""
    body, neck = rng.uniform(0.12, 0.22), rng.uniform(0.05, 0.075)
    shoulder, top = rng.uniform(0.45, 0.7), rng.uniform(0.76, 0.86)
    waist = body * rng.uniform(0.75, 1.0)
    heights = [0.0, 0.04, shoulder / 2, shoulder, top, 1.0]
    curve = profile(heights, [0.9 * body, body, waist, body, neck, neck], samples=14)
    if rng.random() < 0.3:  # a flask: flattened
        return revolve(curve).scale((1, rng.uniform(0.45, 0.7), 1))
    solid = revolve(curve)
    if rng.random() < 0.5:
        lip = ring(neck, 0.022, (0, 0, 0.965))
        return solid + lip - cavity(curve, 0.038)
    cap = neck + rng.uniform(0.012, 0.03)
    return solid + disc(cap, rng.uniform(0.07, 0.13), (0, 0, 0.93))


def bowl(rng: np.random.Generator) -> Manifold:
    """A deep open vessel, wider at the rim, on a foot."""
    height, foot = rng.uniform(0.28, 0.5), rng.uniform(0.15, 0.26)
    belly = rng.uniform(0.36, 0.46)
    curve = profile([0, 0.35 * height, 0.7 * height, height], [foot, belly * 0.9, 0.48, 0.5], samples=9)
    solid = revolve(curve) + disc(foot * 1.05, 0.05, (0, 0, -0.02))
    return solid - cavity(curve, rng.uniform(0.035, 0.06))


def dish(rng: np.random.Generator) -> Manifold:
    """A shallow plate, round or oval."""
    height, flat = rng.uniform(0.1, 0.24), rng.uniform(0.2, 0.4)
    # the last stretch is upright: a rim cut level from a sloping wall would be a knife's edge
    middle = [(flat + 0.5) / 2, height * rng.uniform(0.25, 0.45)]
    curve = np.array([[flat, 0.0], middle, [0.5, height - 0.04], [0.5, height]])
    plate = revolve(curve, 32) - cavity(curve, rng.uniform(0.045, 0.055), 32)
    return plate.scale((1, rng.uniform(0.6, 1.0), 1))


def cup(rng: np.random.Generator) -> Manifold:
    """A mug or tea cup with one swept handle, or none, or two."""
    height = rng.uniform(0.6, 1.0)
    foot, belly, rim = rng.uniform(0.22, 0.34), rng.uniform(0.3, 0.38), rng.uniform(0.32, 0.42)
    curve = profile([0, height / 2, height], [foot, belly, rim], samples=7)
    solid = revolve(curve)
    reach, tube = rng.uniform(0.16, 0.26), rng.uniform(0.04, 0.06)
    low, high = height * rng.uniform(0.15, 0.3), height * rng.uniform(0.7, 0.88)
    turn = np.linspace(-np.pi / 2, np.pi / 2, 7)
    x = min(foot, belly) - 0.02 + (reach + 0.05) * np.cos(turn)
    z = (low + high) / 2 + (high - low) / 2 * np.sin(turn)
    handle = rod([(a, 0, b) for a, b in zip(x, z, strict=True)], tube)
    handles = rng.choice([0, 1, 2], p=[0.15, 0.7, 0.15])
    solid = unite([solid, *(handle.rotate((0, 0, 180 * k)) for k in range(handles))])
    return solid - cavity(curve, rng.uniform(0.04, 0.055))


def vase(rng: np.random.Generator) -> Manifold:
    """A tall open vessel, round, oval or many-sided."""
    heights = [0, rng.uniform(0.25, 0.4), rng.uniform(0.7, 0.85), 1.0]
    radii = [rng.uniform(0.12, 0.2), rng.uniform(0.2, 0.34), rng.uniform(0.1, 0.16), rng.uniform(0.13, 0.24)]
    if rng.random() < 0.3:  # flares steadily instead of narrowing to a neck
        radii = sorted(radii)
    sides = int(rng.choice([6, 24, 24, 24]))
    curve = profile(heights, radii, samples=12)
    solid = revolve(curve, sides)
    if rng.random() < 0.25:  # an amphora's two handles
        turn = np.linspace(-np.pi / 2, np.pi / 2, 7)
        low, high = heights[1], heights[2] + 0.06
        x = radii[2] * 0.9 + 0.22 * np.cos(turn)
        z = (low + high) / 2 + (high - low) / 2 * np.sin(turn)
        handle = rod([(a, 0, b) for a, b in zip(x, z, strict=True)], 0.028)
        solid = solid + handle + handle.rotate((0, 0, 180))
    return solid - cavity(curve, rng.uniform(0.038, 0.05), sides)


def lamp(rng: np.random.Generator) -> Manifold:
    """A table lamp under a shade, or a desk lamp on a bent arm."""
    foot = rng.uniform(0.14, 0.22)
    base = disc(foot, rng.uniform(0.04, 0.07), top_radius=foot * rng.uniform(0.7, 1.0))
    if rng.random() < 0.6:
        height, depth = rng.uniform(0.75, 1.0), rng.uniform(0.22, 0.35)
        wide, narrow = rng.uniform(0.2, 0.32), rng.uniform(0.1, 0.19)
        shade = np.array([[narrow, 0.0], [wide, depth]])  # built bottom up, then hung upside down
        hung = (revolve(shade) - cavity(shade, 0.038)).rotate((180, 0, 0)).translate((0, 0, height))
        bulge = rng.uniform(0.03, 0.1)
        stem = revolve(profile([0.02, 0.3 * height, height - 0.02], [0.05, bulge, 0.03], samples=9), 16)
        return base + stem + hung
    elbow = (rng.uniform(-0.2, -0.05), 0.0, rng.uniform(0.4, 0.55))
    head = (rng.uniform(0.15, 0.35), 0.0, rng.uniform(0.65, 0.85))
    arm = rod([(0, 0, 0.04), elbow, head], rng.uniform(0.022, 0.035))
    shade = profile([0, 0.1, rng.uniform(0.2, 0.28)], [0.06, 0.09, rng.uniform(0.12, 0.17)], samples=5)
    bell = (revolve(shade) - cavity(shade, 0.036)).rotate((0, rng.uniform(130, 170), 0)).translate(head)
    return base + arm + bell


def cone(rng: np.random.Generator) -> Manifold:
    """A traffic cone, slender or squat, on a square or round plate; collars on some."""
    radius, tip = rng.uniform(0.14, 0.42), rng.uniform(0.03, 0.12)
    edge, thick = 2 * radius + rng.uniform(0.06, 0.34), rng.uniform(0.04, 0.14)
    rounding = rng.uniform(0.02, 0.1) if rng.random() < 0.6 else 0.49 * edge
    plate = slab(rectangle(edge, edge, rounding), thick)
    collars = []
    for height in rng.uniform(0.25, 0.75, rng.integers(0, 3)):
        around = radius + (tip - radius) * height  # of the cone there
        collars.append(disc(around + rng.uniform(0.02, 0.05), rng.uniform(0.05, 0.15), (0, 0, height)))
    return unite([plate, disc(radius, 1.0, top_radius=tip), *collars])


def bathtub(rng: np.random.Generator) -> Manifold:
    """A rounded trough, freestanding on feet or boxed in."""
    width, height, wall = rng.uniform(0.42, 0.55), rng.uniform(0.25, 0.36), rng.uniform(0.038, 0.055)
    flare = rng.uniform(1.05, 1.2)
    rounding = rng.uniform(0.08, 0.48 * width)
    basin = rectangle(0.9, width, rounding)
    trough = slab(basin.offset(-wall), height, (0, 0, wall), (flare, flare))
    if rng.random() < 0.4:  # boxed in
        return box((0.9 * flare + 0.04, width * flare + 0.04, height), (0, 0, height / 2)) - trough
    parts = [slab(basin, height, scale_top=(flare, flare))]
    for x in (-0.28, 0.28):
        for y in (-0.25 * width, 0.25 * width):
            parts.append(ball((0.045, 0.045, 0.08), (x, y, -0.02), 8))
    rim = outline(np.array(basin.to_polygons()[0])).scale((flare, flare)).offset(0.03)
    parts.append(slab(rim, 0.04, (0, 0, height - 0.04)))
    return unite(parts) - trough
