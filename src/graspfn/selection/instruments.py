"""Musical instruments: guitar, piano."""

from __future__ import annotations

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold

from graspfn.selection.primitives import SEGMENTS, box, disc, outline, rectangle, rod, slab, unite


def guitar(rng: np.random.Generator) -> Manifold:
    """Body with a waist, neck and head; acoustic with a sound hole or a thin electric one."""
    lower, upper = rng.uniform(0.13, 0.25), rng.uniform(0.1, 0.17)
    waist = rng.uniform(0.2, 0.32)
    bouts = CrossSection.circle(lower, SEGMENTS) + CrossSection.circle(upper, SEGMENTS).translate((waist, 0))
    body = bouts.offset(0.07, JoinType.Round, circular_segments=16).offset(-0.07, JoinType.Round, circular_segments=16)
    electric = rng.random() < 0.4
    depth = rng.uniform(0.05, 0.075) if electric else rng.uniform(0.08, 0.16)
    if electric:  # a cutaway leaves a horn beside the neck
        body = body - CrossSection.circle(0.085, 16).translate((waist + upper, upper * 0.75))
    solid = slab(body.simplify(0.003), depth)
    if not electric:
        solid -= disc(rng.uniform(0.05, 0.065), depth, (waist * 0.75, 0, 0.45 * depth))
    end, width = rng.uniform(0.6, 0.9), rng.uniform(0.05, 0.08)
    neck = box((end - waist, width, 0.042), ((end + waist) / 2, 0, depth))
    long, broad = rng.uniform(0.1, 0.22), rng.uniform(0.05, 0.085)
    head = slab(outline([(0, -0.04), (long, -broad), (long, broad), (0, 0.04)]), 0.04)
    head = head.rotate((0, rng.uniform(5, 14), 0)).translate((end - 0.015, 0, depth - 0.02))
    bridge = box((0.04, 0.14, 0.03), (-0.35 * lower, 0, depth + 0.01))
    return unite([solid, neck, head, bridge])


def piano(rng: np.random.Generator) -> Manifold:
    """An upright or a grand, the player's side towards -y."""
    whole = _grand(rng) if rng.random() < 0.5 else _upright(rng)
    return whole.scale((rng.uniform(0.75, 1.3), rng.uniform(0.85, 1.15), rng.uniform(0.85, 1.2)))


def _keys(width: float, count: int, long: float) -> list[Manifold]:
    """A row of white keys about x = y = 0, standing out of z = 0, with black ones between."""
    pitch = width / count
    white = [box((pitch - 0.015, long, 0.04), ((k - (count - 1) / 2) * pitch, 0, 0)) for k in range(count)]
    gaps = [k for k in range(1, count) if k % 7 not in (0, 3)]
    return white + [box((0.5 * pitch, 0.55 * long, 0.06), ((k - count / 2) * pitch, 0.22 * long, 0.015)) for k in gaps]


def _upright(rng: np.random.Generator) -> Manifold:
    """A tall case, its keys on a ledge between cheeks."""
    height, depth = rng.uniform(0.72, 0.98), rng.uniform(0.2, 0.27)
    desk, out, thick = rng.uniform(0.4, 0.48), rng.uniform(0.16, 0.22), rng.uniform(0.05, 0.08)
    front, panels = -depth / 2, int(rng.integers(1, 4))
    wide = 0.94 / panels
    recess = box((wide - 0.05, 0.05, desk - 0.17), (0, front, desk / 2 - 0.01))
    recesses = [recess.translate(((k - (panels - 1) / 2) * wide, 0, 0)) for k in range(panels)]
    parts = [box((1.0, depth, height), (0, 0, height / 2)) - unite(recesses)]
    ledge = [box((1.0, out + 0.02, thick), (0, 0.01, desk))]
    ledge += [key.translate((0, 0, desk + thick / 2)) for key in _keys(0.86, int(rng.integers(11, 16)), 0.75 * out)]
    posts = rng.random() < 0.8
    for x in (-0.465, 0.465):
        ledge += [box((0.07, out, 0.13), (x, 0, desk + 0.03)), box((0.07, out + 0.04, 0.05), (x, 0.02, 0.025))]
        if posts:
            ledge.append(box((0.06, 0.06, desk), (x, 0.04 - out / 2, desk / 2)))
    parts += [part.translate((0, front - out / 2, 0)) for part in ledge]
    if rng.random() < 0.6:
        parts.append(box((1.03, depth + 0.04, 0.045), (0, -0.01, height)))
    if rng.random() < 0.6:
        music = box((rng.uniform(0.3, 0.6), 0.04, 0.16)).rotate((-12, 0, 0))
        parts.append(music.translate((0, front - 0.02, desk + 0.22)))
    return unite([*parts, box((0.2, 0.09, 0.04), (0, front - 0.03, 0.03))])


def _grand(rng: np.random.Generator) -> Manifold:
    """A wing on three legs, its lid up or shut."""
    long, deep, low = rng.uniform(0.75, 1.05), rng.uniform(0.12, 0.17), rng.uniform(0.3, 0.38)
    bent = [(0.45, 0.36), (0.42, 0.46), (0.3, 0.55), (0.15, 0.66), (0.04, 0.82), (-0.08, 0.95), (-0.22, 1.0)]
    plan = outline([(-0.45, 0), (0.45, 0), *bent, (-0.38, 0.97), (-0.45, 0.88)]).scale((1, long))
    bed, top = low + 0.55 * deep, low + deep
    parts = [slab(plan, deep, (0, 0, low)) - box((0.8, 0.34, deep), (0, 0, bed + deep / 2))]
    parts += [key.translate((0, 0.08, bed)) for key in _keys(0.78, int(rng.integers(10, 15)), 0.13)]
    lid = slab((plan ^ rectangle(2, 2).translate((0, 1.17))).offset(0.015), 0.042)
    if rng.random() < 0.6:
        tilt = rng.uniform(25, 40)
        strings = plan.offset(-0.05) ^ rectangle(2, 2).translate((0, 1.25))
        parts[0] -= slab(strings, deep, (0, 0, low + 0.05))
        parts.append(lid.translate((0.45, 0, 0)).rotate((0, -tilt, 0)).translate((-0.45, 0, top - 0.01)))
        end = 0.78 * np.array([np.cos(np.radians(tilt)), np.sin(np.radians(tilt))])
        parts.append(rod([(0.43, 0.3 * long, top - 0.03), (end[0] - 0.45, 0.3 * long, top + end[1])], 0.024, 6))
    else:
        parts.append(lid.translate((0, 0, top - 0.005)))
    foot, sides = rng.uniform(0.03, 0.045), int(rng.choice([4, 12]))
    leg = Manifold.cylinder(low + 0.03, foot, 1.5 * foot, sides)
    parts += [leg.translate(place) for place in ((-0.37, 0.1, 0), (0.37, 0.1, 0), (-0.2, 0.85 * long, 0))]
    parts.append(box((0.4, 0.04, 0.17)).rotate((-20, 0, 0)).translate((0, 0.2, top + 0.05)))  # for the music
    parts += [box((0.05, 0.04, low), (x, 0.22, low / 2 + 0.03)) for x in (-0.06, 0.06)]
    return unite([*parts, box((0.2, 0.1, 0.045), (0, 0.2, 0.05))])
