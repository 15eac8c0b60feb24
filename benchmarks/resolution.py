"""Would a finer Q pay? Planning by the labels themselves, binned at 10 mm and 30 degrees, at half and a quarter of it.

    python benchmarks/resolution.py

In a folder where test objects are labelled. Of each graspable one's attempts all but every fifth are binned, spread
over cells of 2.5 mm and 7.5 degrees, smoothed with each uncertainty there, and the highest pose is judged by the
attempts left out. All have the same attempts: what differs is how well it is known where these were.
"""

from __future__ import annotations

import argparse
import itertools

import numpy as np
import pandas as pd
from learning import CELLS, graspable, success
from objects import committed
from scipy.ndimage import gaussian_filter

from graspfn.evaluation.ceiling import FOLDS
from graspfn.evaluation.expected import Attempts
from graspfn.geometry import grid

FINEST = 4  # cells of the finest binning to one of Q, along each axis
FINER = (1, 2, 4)
LEAST = 1e-3  # attempts in a cell, of the mean: beyond that a ratio says nothing


def binned(attempts: Attempts, finer: int) -> tuple[np.ndarray, np.ndarray]:
    """Attempts held and made, (33, 44, 6) times FINEST each, spread evenly over the cells of their bins."""
    size = np.array(grid.SHAPE) * finer
    index = np.floor((grid.to_index(attempts.q) + 0.5) * finer).astype(int).reshape(-1, 3)
    index[:, :2] = index[:, :2].clip(0, size[:2] - 1)
    index[:, 2] %= size[2]
    flat = np.ravel_multi_index(tuple(index.T), tuple(size))
    total = int(size.prod())
    held = np.bincount(flat, attempts.held.ravel(), total).reshape(size)
    made = np.bincount(flat, minlength=total).reshape(size).astype(float)
    each = np.full((FINEST // finer,) * 3, (finer / FINEST) ** 3)
    return np.kron(held, each), np.kron(made, each)


def best_pose(held: np.ndarray, made: np.ndarray, cell: tuple[float, float]) -> np.ndarray:
    """Pose (3,) with the highest share of attempts held, weighted by the density of the pose that is reached."""
    along, turned = FINEST * cell[0] / 1e3 / grid.CELL_M, FINEST * np.radians(cell[1]) / grid.CELL_RAD
    sigmas, modes = (along, along, turned), ("constant", "constant", "wrap")
    above, below = (gaussian_filter(part, sigmas, mode=modes, truncate=3.5) for part in (held, made))
    share = np.where(below > LEAST * made.mean(), above / below.clip(1e-12), 0)
    best = np.array(np.unravel_index(share.argmax(), share.shape))
    return grid.from_index((best + 0.5) / FINEST - 0.5)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folds", type=int, default=FOLDS, help="of the five, how many to take")
    folds = parser.parse_args().folds
    lines = []
    for one in graspable(committed(), "height_map"):
        fold = np.arange(one.attempts.held.shape[-1]) % FOLDS
        for out, finer in itertools.product(range(folds), FINER):
            held, made = binned(one.attempts.only(fold != out), finer)
            left = one.attempts.only(fold == out)
            for cell in CELLS:
                q = best_pose(held, made, cell)
                lines.append({"finer": finer, "cell": str(cell), "success": success(q, cell, left)})
    table = pd.DataFrame(lines)
    print(table.pivot_table(index="finer", columns="cell", values="success", margins=True).round(4).to_string())


if __name__ == "__main__":
    main()
