"""From a grasp function to the pose to command: milliseconds, beside the full fine grid, and how exact it is.

    python benchmarks/planning.py data/functions/fcn-0.npz

Of every predicted function under four diagonal and four full covariances: processor time of smoothing and refinement on
one thread, and by how much the maximum of the full fine grid is missed. Then, at one pose of each, how far the smoothed
function is from a million draws.
"""

from __future__ import annotations

import argparse
import functools
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

from graspfn.compose import compose
from graspfn.geometry import grid
from graspfn.params import Plan, validate
from graspfn.planning.coupled import Coupled
from graspfn.planning.robust import RobustFunction
from graspfn.planning.smoothing import fine_axes, robust_function_at
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.workflow.files import read_npz

SIGMAS = ((2.0, 3.0), (5.0, 10.0), (10.0, 20.0), (20.0, 40.0))  # mm, degrees
DRAWS = 1_000_000


def full(uv_mm: float, theta_deg: float, rank: int) -> np.ndarray:
    """A covariance (3, 3) of these standard deviations and of that rank, whose axes correlate as a draw has it."""
    factor = np.random.default_rng(rank).normal(size=(3, rank))
    factor *= (np.array([uv_mm / 1e3, uv_mm / 1e3, np.radians(theta_deg)]) / np.linalg.norm(factor, axis=1))[:, None]
    return factor @ factor.T


def on_full_grid(f: np.ndarray, sigma: PoseUncertainty, plan: Plan) -> float:
    """The maximum over every pose of the fine grid."""
    if sigma.sigmas is not None:
        return float(robust_function_at(f, sigma.sigmas, *fine_axes(plan.fine_uv, plan.fine_theta)).max())
    coupled, best = Coupled(f, sigma.covariance_at(np.zeros(3))), 0.0
    for v, u, theta in np.ndindex(plan.fine_uv, plan.fine_uv, plan.fine_theta):
        values = coupled.on_q((v / plan.fine_uv, u / plan.fine_uv, theta / plan.fine_theta))
        best = max(best, float(values[: len(values) - (v > 0), : values.shape[1] - (u > 0)].max()))
    return best


def refined(f: np.ndarray, sigma: PoseUncertainty, plan: Plan) -> float:
    found = RobustFunction(f, sigma).highest(plan)
    return found.value if found else 0.0


def missed_draws(f: np.ndarray, sigma: PoseUncertainty) -> float:
    """By how much the smoothed function differs from the mean of draws about the best pose of Q."""
    best = np.array(np.unravel_index(f.argmax(), f.shape))
    q = grid.from_index(best + np.array([0.3, -0.2, 0.4]))
    errors = np.random.default_rng(0).multivariate_normal(np.zeros(3), sigma.covariance_at(q), DRAWS, method="eigh")
    v, u, theta = np.moveaxis(grid.to_index(q + errors), -1, 0)
    padded = np.pad(np.concatenate([f, f[:, :, :1]], axis=2), ((1, 1), (1, 1), (0, 0)))
    drawn = map_coordinates(padded, [v + 1, u + 1, theta % grid.SHAPE[2]], order=1, mode="constant")
    return abs(float(RobustFunction(f, sigma).at(q[None]).item() - drawn.mean()))


def milliseconds(function: Callable[[], object]) -> float:
    """Of processor time, the best of five."""
    taken = []
    for _ in range(5):
        started = time.process_time()
        function()
        taken.append(1e3 * (time.process_time() - started))
    return min(taken)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("functions", type=Path, help="a file of stage predict")
    parser.add_argument("--count", type=int, default=20, help="of the functions in it, the first")
    args = parser.parse_args()
    plan, functions = validate(compose([])).plan, read_npz(args.functions)["scores"][: args.count].astype(float)
    kinds = [("diagonal", PoseUncertainty.of(*sigma), sigma) for sigma in SIGMAS]
    kinds += [(f"rank {rank}", PoseUncertainty(full(*sigma, rank)), sigma) for sigma in SIGMAS for rank in (1, 2, 3)]
    for kind, sigma, (uv, theta) in kinds:
        refined(functions[0], sigma, plan)
        taken, all_poses, missed = [], [], []
        for f in functions:
            taken.append(milliseconds(functools.partial(refined, f, sigma, plan)))
            started = time.process_time()
            best = on_full_grid(f, sigma, plan)
            all_poses.append(1e3 * (time.process_time() - started))
            missed.append(best - refined(f, sigma, plan))
        print(
            f"{kind:8} {uv:2g} mm {theta:2g} deg: median {np.median(taken):5.2f} ms, most {max(taken):5.2f} ms, "
            f"full grid {np.median(all_poses):5.1f} ms; missed {max(missed):.0e}; "
            f"draws {missed_draws(functions[0], sigma):.0e}"
        )


if __name__ == "__main__":
    main()
