"""The noise of a structured-light depth camera, eq. 2 of the paper (IV-B)."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from graspfn.params import Noise
from graspfn.seeds import generator


def add_noise(depth: np.ndarray, noise: Noise, rng: np.random.Generator) -> np.ndarray:
    """depth: (height, width), metres -> (height, width) float32, every pixel read askew and with an error.

    z^(u, v) = z(u + N(0, sp^2), v + N(0, sp^2)) + N(0, sd^2), all draws independent.
    z is read between pixels bilinearly: eq. 2 takes it at real coordinates, and rounding to the nearest pixel would add
    a further 1/12 px^2 to sp^2. Past its edge the image continues with its outermost pixels.
    """
    jitter_v, jitter_u, error = rng.standard_normal((3, *depth.shape), dtype=np.float32)
    rows, columns = np.ogrid[: depth.shape[0], : depth.shape[1]]
    askew = ndimage.map_coordinates(
        depth, [rows + noise.sigma_p_px * jitter_v, columns + noise.sigma_p_px * jitter_u], order=1, mode="nearest"
    )
    return (askew + noise.sigma_d_mm / 1000 * error).astype(np.float32)


def observe(depth: np.ndarray, noise: Noise, seed: int, name: str) -> np.ndarray:
    """The one noisy image (height, width) of test object `name` that every method plans on."""
    return add_noise(np.asarray(depth), noise, generator(seed, "observe", name))
