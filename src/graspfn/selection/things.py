"""Things of no other kind: glass box, hammer, person."""

from __future__ import annotations

import numpy as np
from manifold3d import CrossSection, Manifold

from graspfn.selection.primitives import ball, box, disc, outline, rectangle, rod, slab, unite


def hammer(rng: np.random.Generator) -> Manifold:
    """Handle along x; the head a claw, a ball or cross peen, or a mallet's block."""
    grip, end = rng.uniform(0.035, 0.065), rng.uniform(0.2, 0.45)
    neck = max(grip * rng.uniform(0.5, 1.0), 0.026)
    handle = rod([(0, 0, 0), (end, 0, 0), (end + 0.15, 0, 0), (1, 0, 0)], [grip, grip * 1.1, neck, neck])
    handle = handle.scale((1, 1, rng.uniform(0.7, 1.0)))
    kind = rng.choice(["claw", "ball", "cross", "mallet"])
    if kind == "mallet":
        radius, half = rng.uniform(0.08, 0.17), rng.uniform(0.14, 0.3)
        block = disc(radius, 2 * half)
        if rng.random() < 0.5:
            block = box((2 * radius, 1.6 * radius, 2 * half), (0, 0, half))
        return handle + block.rotate((90, 0, 0)).translate((0.94, half, 0))
    face, reach = rng.uniform(0.05, 0.08), rng.uniform(0.12, 0.24)
    poll = disc(face * 0.75, reach).rotate((90, 0, 0)) + disc(face, 0.05).rotate((90, 0, 0)).translate((0, -reach, 0))
    cheek = box((0.11, 0.12, 0.1))
    if kind == "claw":
        peen = _claw(rng.uniform(0.16, 0.32))
    elif kind == "ball":
        out = rng.uniform(0.1, 0.2)
        peen = rod([(0, 0, 0), (0, out - 0.03, 0)], 0.04) + ball((face, face, face), (0, out, 0))
    else:
        wedge = outline([(-0.05, 0), (0.05, 0), (0.018, reach), (-0.018, reach)])
        peen = slab(wedge, 0.1, (0, 0, -0.05))
    return handle + unite([poll, cheek, peen]).scale([rng.uniform(0.8, 1.5)] * 3).translate((0.95, 0, 0))


def _claw(reach: float) -> Manifold:
    """Two prongs that curve back towards the grip."""
    turn = np.linspace(0, np.pi / 3, 5)
    y, x = reach * np.sin(turn) / np.sin(np.pi / 3), -0.5 * reach * (1 - np.cos(turn))
    parts = []
    for side in (-1, 1):
        spread = side * np.linspace(0.015, 0.045, 5)
        parts.append(rod(np.column_stack([x, y, spread]), np.linspace(0.036, 0.02, 5), 6))
    return unite(parts)


def glass_box(rng: np.random.Generator) -> Manifold:
    """An open tank, or panes or nothing in a frame under a lid, a gable or a pyramid; square or many-sided."""
    width, depth, height = rng.uniform(0.5, 1.0), rng.uniform(0.35, 0.8), rng.uniform(0.3, 0.9)
    sides, wall = int(rng.choice([4, 4, 4, 5, 6, 8])), rng.uniform(0.042, 0.055)
    plan = rectangle(width, depth)
    if sides > 4:
        plan = CrossSection.circle(0.5, sides).scale((width, rng.uniform(0.8, 1.0) * width))
    flare = rng.uniform(0.8, 1.0) if rng.random() < 0.3 else 1.0
    top, kind = plan.scale((flare, flare)), rng.choice(["tank", "panes", "frame"])
    if kind == "tank":
        block = slab(plan, height, scale_top=(flare, flare)) + slab(plan.offset(0.02), 0.06)
        block += slab(top.offset(0.02), 0.05, (0, 0, height - 0.05))
        return block - slab(plan.offset(-wall), height, (0, 0, wall), (flare, flare))
    corners = np.concatenate(plan.to_polygons()) * 0.96
    parts = [rod([(x, y, 0.02), (flare * x, flare * y, height)], 0.032, 6) for x, y in corners]
    parts += [slab(plan, rng.uniform(0.05, 0.12)), slab(top.offset(0.02), 0.05, (0, 0, height - 0.01))]
    if kind == "panes":
        parts.append(slab(plan.offset(-0.03), height, scale_top=(flare, flare)))
    if rng.random() < 0.5:
        ridge = 1.0 if sides == 4 and rng.random() < 0.5 else 0.1
        parts.append(slab(top, rng.uniform(0.1, 0.3), (0, 0, height + 0.03), (0.1, ridge)))
    else:
        parts.append(disc(0.05, 0.07, (0, 0, height + 0.03)))
    return unite(parts)


def person(rng: np.random.Generator) -> Manifold:
    """Facing -y: standing, striding or sitting, in trousers or a skirt, the arms down, out, up, ahead or akimbo."""
    stout, pose = rng.uniform(0.85, 1.3), rng.choice(["stand", "stride", "sit"])
    parts = [
        rod([(0, 0, 0.5), (0, 0, 0.63), (0, 0, 0.76)], np.array([0.1, 0.085, 0.1]) * stout, 10).scale((1, 0.65, 1))
    ]
    parts += [rod([(0, 0, 0.78), (0, 0, 0.9)], 0.04), ball((0.062, 0.07, 0.082), (0, -0.005, 0.94), 12)]
    stride, skirt = rng.uniform(12, 28), pose != "sit" and rng.random() < 0.35
    for side in (-1, 1):
        thigh, shin = {
            "stand": (rng.uniform(0, 4), 0.0),
            "stride": (side * stride, side * stride - rng.uniform(0, 18)),
            "sit": (rng.uniform(80, 92), rng.uniform(-8, 12)),
        }[str(pose)]
        hip = np.array([side * 0.06, 0, 0.5])
        knee = hip + _reach(0.24, thigh, side * rng.uniform(2, 8))
        ankle = knee + _reach(0.24, shin, 0)
        parts.append(rod([hip, knee, ankle], np.array([0.065, 0.048, 0.036]) * stout**0.5))
        parts.append(rod([ankle, ankle + np.array([0, -0.08, -0.015])], 0.032, 6))
        parts.append(_arm(rng, side, stout))
    if skirt:
        parts.append(disc(0.13 * stout, 0.26, (0, 0, 0.3), 0.085 * stout))
    extra = rng.choice(["none", "hat", "hair"])
    if extra == "hat":
        parts += [disc(0.095, 0.03, (0, 0, 0.97)), disc(0.062, 0.07, (0, 0, 0.98))]
    elif extra == "hair":
        parts.append(ball((0.072, 0.07, 0.095), (0, 0.02, 0.93), 10))
    return unite(parts)


def _reach(length: float, ahead_deg: float, out_deg: float) -> np.ndarray:
    """A limb that hangs, swung ahead (-y) and then out (+x)."""
    a, b = np.radians([ahead_deg, out_deg])
    return length * np.array([np.sin(b), -np.sin(a) * np.cos(b), -np.cos(a) * np.cos(b)])


def _arm(rng: np.random.Generator, side: int, stout: float) -> Manifold:
    shoulder = np.array([side * 0.1 * stout, 0, 0.77])
    kind = rng.choice(["down", "out", "up", "ahead", "akimbo"], p=[0.4, 0.15, 0.15, 0.15, 0.15])
    upper, lower, lift = {
        "down": (8, 0, 5),
        "out": (75, 85, 0),
        "up": (140, 160, 0),
        "ahead": (15, 0, 70),
        "akimbo": (45, -35, 10),
    }[str(kind)]
    jitter = rng.uniform(-7, 7, 2)
    elbow = shoulder + _reach(0.17, lift, side * (upper + jitter[0] + 10 * (stout - 0.9)))
    hand = elbow + _reach(0.16, lift + 10, side * (lower + jitter[1]))
    return rod([shoulder, elbow, hand], [0.045, 0.036, 0.03]) + ball((0.036, 0.036, 0.042), hand, 8)
