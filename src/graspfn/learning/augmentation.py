"""The table of augmented samples (paper VII): each training image shifted and turned many times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from graspfn.imaging.camera import Camera
from graspfn.imaging.placement import random_placements
from graspfn.seeds import generator


def augmentation_table(images: np.ndarray, ids: Sequence[str], camera: Camera, samples: int, seed: int) -> pd.DataFrame:
    """images: (N, 480, 640) noise-free, metres -> N * samples lines, sorted by image.

    Columns: row (int64, of `images`), shift_u_m, shift_v_m, theta_rad (float64, the motion of `T_world_scene`) and
    noise_seed (uint32). The draws of an image depend on its id and the seed, not on the other images.
    """
    parts = []
    for row, (image, name) in enumerate(zip(images, ids, strict=True)):
        placing, noise = generator(seed, "augment", "placement", name), generator(seed, "augment", "noise", name)
        shifts, theta = random_placements(image, camera, placing, samples)
        parts.append(
            pd.DataFrame(
                {
                    "row": row,
                    "shift_u_m": shifts[:, 0],
                    "shift_v_m": shifts[:, 1],
                    "theta_rad": theta,
                    "noise_seed": noise.integers(2**32, size=samples, dtype=np.uint32),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)
