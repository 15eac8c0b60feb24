"""The table of augmented samples (paper VII): each training image shifted, turned and mirrored many times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from graspfn.imaging.camera import Intrinsics
from graspfn.imaging.placement import random_placements
from graspfn.params import Augment
from graspfn.seeds import generator


def augmentation_table(
    images: np.ndarray, ids: Sequence[str], intrinsics: Intrinsics, augment: Augment, seed: int
) -> pd.DataFrame:
    """images: (N, 480, 640) noise-free, metres -> N * augment.samples lines, sorted by image.

    Columns: row (int64, of `images`), shift_u_m, shift_v_m, theta_rad (float64, the motion of `T_world_scene`),
    mirrored (bool, v becomes -v after the motion), empty (bool, the object is taken away) and noise_seed (uint32).
    The draws of an image depend on its id and the seed, not on the other images.
    """
    parts = []
    for row, (image, name) in enumerate(zip(images, ids, strict=True)):
        placing, noise, mirror, empty = (
            generator(seed, "augment", what, name) for what in ("placement", "noise", "mirror", "empty")
        )
        shifts, theta = random_placements(image, intrinsics, placing, augment.samples)
        parts.append(
            pd.DataFrame(
                {
                    "row": row,
                    "shift_u_m": shifts[:, 0],
                    "shift_v_m": shifts[:, 1],
                    "theta_rad": theta,
                    "mirrored": (mirror.random(augment.samples) < 0.5) & augment.mirror,
                    "empty": empty.random(augment.samples) < augment.empty,
                    "noise_seed": noise.integers(2**32, size=augment.samples, dtype=np.uint32),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)
