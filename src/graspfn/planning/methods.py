"""From a grasp function to the pose to command: Best Grasp and Robust Best Grasp (paper V-A)."""

from __future__ import annotations

import numpy as np

from graspfn.geometry import grid
from graspfn.params import Plan
from graspfn.planning.smoothing import fine_axes, robust_function_at

METHODS = ("Centroid", "Best Grasp", "Robust Best Grasp")

# Rounding differs by this much between poses that symmetry makes equal; a score's own resolution is far coarser.
TIE = 1e-12


def _highest(values: np.ndarray, rng: np.random.Generator) -> tuple[int, ...]:
    """Index of the largest of values (...); among equals each is as likely, so that no corner of Q is favoured."""
    peaks = np.flatnonzero(values >= values.max() - TIE)
    return tuple(int(i) for i in np.unravel_index(rng.choice(peaks), values.shape))


def best_grasp(f: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Pose (3,) (u [m], v [m], theta [rad]) of Q where f (33, 44, 6) is highest."""
    return grid.from_index(np.array(_highest(f, rng)))


def robust_best_grasp(
    f: np.ndarray, sigma_uv_m: float, sigma_theta_rad: float, plan: Plan, rng: np.random.Generator
) -> np.ndarray:
    """Pose (3,) (u [m], v [m], theta [rad]) within Q's extents whose expected score under Sigma is highest."""
    v, u, theta = fine_axes(plan.fine_uv, plan.fine_theta)
    i, j, k = _highest(robust_function_at(f, sigma_uv_m, sigma_theta_rad, v, u, theta), rng)
    return np.array([u[j], v[i], theta[k]])
