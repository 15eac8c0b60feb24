"""The table of augmented samples (paper VII): each training image shifted, turned and mirrored many times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from graspfn.imaging.placement import random_placements_above
from graspfn.params import Augment
from graspfn.seeds import generator


def augmentation_table(maps: np.ndarray, ids: Sequence[str], augment: Augment, seed: int) -> pd.DataFrame:
    """maps: (N, 264, 352) of `imaging.orthographic` -> N * augment.samples lines, sorted by object.

    Columns: row (int64, of `maps`), shift_u_m, shift_v_m, theta_rad (float64, the motion of `T_world_scene`),
    mirrored (bool, v becomes -v after the motion), empty (bool, the object is taken away) and noise_seed (uint32).
    The draws of an object depend on its id and the seed, not on the others, nor on the camera.
    """
    parts = []
    for row, (heights, name) in enumerate(zip(maps, ids, strict=True)):
        placing, noise, mirror, empty = (
            generator(seed, "augment", what, name) for what in ("placement", "noise", "mirror", "empty")
        )
        shifts, theta = random_placements_above(heights, placing, augment.samples)
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
