"""Household objects assembled from plates, blocks and rods: airplane, guitar, hammer, keyboard, monitor."""

from __future__ import annotations

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold

from graspfn.selection.primitives import (
    SEGMENTS,
    ball,
    box,
    disc,
    outline,
    profile,
    rectangle,
    revolve,
    rod,
    slab,
    unite,
)


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


def guitar(rng: np.random.Generator) -> Manifold:
    """Body with a waist, neck and head; acoustic with a sound hole or a thin electric one."""
    lower, upper = rng.uniform(0.17, 0.21), rng.uniform(0.12, 0.16)
    waist = rng.uniform(0.22, 0.27)
    bouts = CrossSection.circle(lower, SEGMENTS) + CrossSection.circle(upper, SEGMENTS).translate((waist, 0))
    body = bouts.offset(0.07, JoinType.Round, circular_segments=16).offset(-0.07, JoinType.Round, circular_segments=16)
    electric = rng.random() < 0.4
    depth = rng.uniform(0.05, 0.065) if electric else rng.uniform(0.09, 0.12)
    if electric:  # a cutaway leaves a horn beside the neck
        body = body - CrossSection.circle(0.085, 16).translate((waist + upper, upper * 0.75))
    solid = slab(body.simplify(0.003), depth)
    if not electric:
        solid -= disc(rng.uniform(0.05, 0.065), depth, (waist * 0.75, 0, 0.45 * depth))
    end, width = rng.uniform(0.68, 0.75), rng.uniform(0.05, 0.065)
    neck = box((end - waist, width, 0.042), ((end + waist) / 2, 0, depth))
    head = slab(outline([(0, -0.04), (0.13, -0.055), (0.13, 0.055), (0, 0.04)]), 0.04)
    head = head.rotate((0, rng.uniform(5, 14), 0)).translate((end - 0.015, 0, depth - 0.02))
    bridge = box((0.04, 0.14, 0.03), (-0.35 * lower, 0, depth + 0.01))
    return unite([solid, neck, head, bridge])


def hammer(rng: np.random.Generator) -> Manifold:
    """Handle along x; the head a claw, a ball or cross peen, or a mallet's block."""
    grip = rng.uniform(0.032, 0.05)
    handle = rod([(0, 0, 0), (0.3, 0, 0), (0.45, 0, 0), (1, 0, 0)], [grip, grip * 1.1, grip * 0.75, grip * 0.75])
    handle = handle.scale((1, 1, rng.uniform(0.7, 1.0)))
    kind = rng.choice(["claw", "ball", "cross", "mallet"])
    if kind == "mallet":
        radius, half = rng.uniform(0.09, 0.14), rng.uniform(0.16, 0.24)
        block = disc(radius, 2 * half)
        if rng.random() < 0.5:
            block = box((2 * radius, 1.6 * radius, 2 * half), (0, 0, half))
        return handle + block.rotate((90, 0, 0)).translate((0.94, half, 0))
    face, reach = rng.uniform(0.055, 0.075), rng.uniform(0.14, 0.2)
    poll = disc(face * 0.75, reach).rotate((90, 0, 0)) + disc(face, 0.05).rotate((90, 0, 0)).translate((0, -reach, 0))
    cheek = box((0.11, 0.12, 0.1))
    if kind == "claw":
        peen = _claw(rng.uniform(0.2, 0.28))
    elif kind == "ball":
        peen = rod([(0, 0, 0), (0, 0.13, 0)], 0.04) + ball((face, face, face), (0, 0.16, 0))
    else:
        wedge = outline([(-0.05, 0), (0.05, 0), (0.018, reach), (-0.018, reach)])
        peen = slab(wedge, 0.1, (0, 0, -0.05))
    return handle + unite([poll, cheek, peen]).translate((0.95, 0, 0))


def _claw(reach: float) -> Manifold:
    """Two prongs that curve back towards the grip."""
    turn = np.linspace(0, np.pi / 3, 5)
    y, x = reach * np.sin(turn) / np.sin(np.pi / 3), -0.5 * reach * (1 - np.cos(turn))
    parts = []
    for side in (-1, 1):
        spread = side * np.linspace(0.015, 0.045, 5)
        parts.append(rod(np.column_stack([x, y, spread]), np.linspace(0.036, 0.02, 5), 6))
    return unite(parts)


def keyboard(rng: np.random.Generator) -> Manifold:
    """A wedge of a case with rows of keys, with or without a number pad."""
    width, depth = rng.uniform(0.65, 1.0), rng.uniform(0.26, 0.38)
    front, back = rng.uniform(0.035, 0.05), rng.uniform(0.05, 0.08)
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
