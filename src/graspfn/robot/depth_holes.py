"""The pixels that a structured-light depth camera would not measure (paper VI, 'depth shadows').

A Carmine's infra-red projector sits 75 mm beside its infra-red camera. What the camera sees but the projector does
not light has no depth: a shadow on the far side of the object. The simulated robot's images get these holes, so that
hole filling has the work it has on a robot.
"""

from __future__ import annotations

import numpy as np

from graspfn.imaging.camera import Camera

BASELINE_M = 0.075  # projector to camera, along the image's +x
DROPOUT = 0.002  # fraction of further pixels lost at random


def projector_shadow(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """(height, width) bool: pixels that see a point which the projector does not; depth: noise-free, metres.

    A point of depth z in camera column x lies in projector column x - f b / z. Seen from the projector's side (from
    the right) the columns of lit points only fall; a point is in shadow where one further right reached a column at
    least as far left, for then the surface between them stands in the projector's way.
    """
    column = np.arange(depth.shape[1]) - camera.K[0] * BASELINE_M / depth
    leftmost = np.minimum.accumulate(column[:, ::-1], axis=1)[:, ::-1]
    shadow = np.zeros(depth.shape, dtype=bool)
    # A hundredth of a column absorbs the float32 of a rendered table.
    shadow[:, :-1] = column[:, :-1] > leftmost[:, 1:] + 0.01
    return shadow


def hole_mask(depth: np.ndarray, camera: Camera, rng: np.random.Generator) -> np.ndarray:
    """(height, width) bool: pixels without a measurement, in the projector's shadow or lost at random."""
    return projector_shadow(depth, camera) | (rng.random(depth.shape) < DROPOUT)
