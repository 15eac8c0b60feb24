"""From a grasp function to the pose to command: Best Grasp and Robust Best Grasp (paper VII-A).

Where no pose has a score above 0 there is nothing to choose by, and no grasp: a method then gives None, as Centroid
does over an empty table, and whoever executes poses says that none was tried.

Among poses as good as each other a robot gets the first in the order of v, u and theta, so that the same image gives
the same grasp. What compares methods hands in a generator, and each of them is as likely: no corner of Q is favoured.
"""

from __future__ import annotations

import numpy as np

from graspfn.geometry import grid
from graspfn.params import Plan
from graspfn.planning.robust import TIE, RobustFunction
from graspfn.planning.smoothing import check_function

CENTROID, BEST, ROBUST = "Centroid", "Best Grasp", "Robust Best Grasp"
LIKELIEST = "Best Grasp (likeliest class)"  # by the scores of the likeliest classes, as the paper has them (V)
METHODS = (CENTROID, LIKELIEST, BEST, ROBUST)


def best_grasp(f: np.ndarray, rng: np.random.Generator | None = None) -> np.ndarray | None:
    """Pose (3,) (u [m], v [m], theta [rad]) of Q where f (33, 44, 6) is highest; None where it is nowhere above 0.

    Raises PlanningError for another f.
    """
    check_function(f)
    highest = f.max()
    if highest <= 0:
        return None
    peaks = np.argwhere(f >= highest - TIE * highest)
    return grid.from_index(_one_of(peaks, rng))


def robust_best_grasp(
    function: RobustFunction, plan: Plan, rng: np.random.Generator | None = None
) -> np.ndarray | None:
    """Pose (3,) (u [m], v [m], theta [rad]) within Q's extents whose expected score under Sigma is highest.

    None where that is nowhere above 0.
    """
    highest = function.highest(plan)
    return None if highest is None else function.between(_one_of(highest.poses, rng), plan)


def _one_of(ties: np.ndarray, rng: np.random.Generator | None) -> np.ndarray:
    """Of equals (K, 3) in the order of v, u and theta the first; with a generator any, each as likely."""
    return ties[0 if rng is None else int(rng.choice(len(ties)))]
