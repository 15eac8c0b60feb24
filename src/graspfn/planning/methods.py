"""From a grasp function to the pose to command: Best Grasp and Robust Best Grasp (paper VII-A).

Where no pose has a score above 0 there is nothing to choose by, and no grasp: a method then gives None, as Centroid
does over an empty table, and whoever executes poses says that none was tried.
"""

from __future__ import annotations

import numpy as np

from graspfn.geometry import grid
from graspfn.params import Plan
from graspfn.planning.smoothing import check_function, fine_axes, robust_function_at

CENTROID, BEST, ROBUST = "Centroid", "Best Grasp", "Robust Best Grasp"
LIKELIEST = "Best Grasp (likeliest class)"  # by the scores of the likeliest classes, as the paper has them (V)
METHODS = (CENTROID, LIKELIEST, BEST, ROBUST)

# Rounding differs by this share between poses that symmetry makes equal; a score's own resolution is far coarser.
TIE = 1e-12


def _highest(values: np.ndarray, rng: np.random.Generator) -> tuple[int, ...] | None:
    """Index of the largest of values (...), None where none is above 0.

    Among equals each is as likely, so that no corner of Q is favoured.
    """
    highest = values.max()
    if highest <= 0:
        return None
    peaks = np.flatnonzero(values >= highest - TIE * highest)
    return tuple(int(i) for i in np.unravel_index(rng.choice(peaks), values.shape))


def best_grasp(f: np.ndarray, rng: np.random.Generator) -> np.ndarray | None:
    """Pose (3,) (u [m], v [m], theta [rad]) of Q where f (33, 44, 6) is highest; None where it is nowhere above 0.

    Raises PlanningError for another f.
    """
    check_function(f)
    highest = _highest(f, rng)
    return None if highest is None else grid.from_index(np.array(highest))


def robust_best_grasp(
    f: np.ndarray, sigma_uv_m: float, sigma_theta_rad: float, plan: Plan, rng: np.random.Generator
) -> np.ndarray | None:
    """Pose (3,) (u [m], v [m], theta [rad]) within Q's extents whose expected score under Sigma is highest.

    None where that is nowhere above 0. Raises PlanningError for another f or no Sigma.
    """
    v, u, theta = fine_axes(plan.fine_uv, plan.fine_theta)
    highest = _highest(robust_function_at(f, sigma_uv_m, sigma_theta_rad, v, u, theta), rng)
    if highest is None:
        return None
    i, j, k = highest
    return np.array([u[j], v[i], theta[k]])
