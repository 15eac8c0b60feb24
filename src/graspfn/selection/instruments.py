"""Musical instruments: guitar."""

from __future__ import annotations

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold

from graspfn.selection.primitives import SEGMENTS, box, disc, outline, slab, unite


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
