"""What to expect of planning by an object's own labels, the ceiling of every network: cross-fitted, no new physics.

The pose that attempts lead to was chosen by their luck, and judged by them it seems better than it is. So every attempt
judges the pose that was planned without it, without all attempts of its fold. That is planned by fewer attempts than
the ceiling is in trials, and so holds a little less often: a network's share of it comes out a little high. Standard
errors are those of independent attempts; but attempts also choose the poses that others judge, so that true ones are up
to half as large again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from graspfn.evaluation.bench import Scene
from graspfn.evaluation.expected import Attempts, Expected, expected_under
from graspfn.evaluation.planner import TRUE, Planner, true_function
from graspfn.planning.uncertainty import PoseUncertainty

FOLDS = 5


def ceilings(
    scene: Scene, planner: Planner, uncertainties: Sequence[PoseUncertainty], attempts: Attempts
) -> list[dict[str, Expected]]:
    """By method, what to expect of planning by the labels under each uncertainty of (sigma_uv, sigma_theta).

    Unknown, hence empty, where there is but one attempt for a pose.
    """
    fold = np.arange(attempts.held.shape[-1]) % FOLDS
    if not fold.max():
        return [{} for _ in uncertainties]
    functions = [true_function(attempts.only(fold != out)) for out in range(fold.max() + 1)]
    plans = [planner.plans(scene, [function], uncertainties) for function in functions]
    found = []
    for uncertainty, of_folds in zip(uncertainties, zip(*plans, strict=True), strict=True):
        poses: dict[str, list[np.ndarray | None]] = {}
        for planned in (one for of_fold in of_folds for one in of_fold if one.network == TRUE):
            poses.setdefault(planned.method, []).append(planned.q)
        found.append({method: _judged(scene, own, fold, uncertainty, attempts) for method, own in poses.items()})
    return found


def _judged(
    scene: Scene,
    poses: Sequence[np.ndarray | None],
    fold: np.ndarray,
    uncertainty: PoseUncertainty,
    attempts: Attempts,
) -> Expected:
    """Of a pose (3,) of the image for each fold, by the attempts of the fold."""
    found = [scene.unmoved(q) for q in poses if q is not None]
    if len(found) < len(poses):  # all that ever held is in one fold, and it judges what was planned without it
        return Expected(0.0, 0.0, float(attempts.held.size))
    return expected_under(np.stack(found)[fold], uncertainty, attempts)
