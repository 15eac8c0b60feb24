"""The robust grasp function under any uncertainty, and where it is highest below the spacing of Q (paper VI).

From coarse to fine: the fine grid is looked at only where the values at the poses of Q leave room for its maximum.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass

import numpy as np

from graspfn.geometry import grid
from graspfn.params import Plan
from graspfn.planning.coupled import FEW, Coupled
from graspfn.planning.smoothing import check_function, fine_axes, hat_weights, robust_function_at, robust_values, smooth
from graspfn.planning.uncertainty import PoseUncertainty

# Rounding differs by this share between poses that symmetry makes equal; a score's own resolution is far coarser.
TIE = 1e-12
# Where errors of position and angle go together, the maximum is searched for from so many places at most, if they have
# so much of the best value that is seen before: at the poses of Q and half a cell between, or at those of Q alone.
MOST_STARTS, SHARE, SHARE_OF_Q = 8, 0.975, 0.8
STARTS_WHERE_SMOOTH = 4  # and at the poses of Q alone, with SHARE
STARTS = 64  # looked at to find them
NEIGHBOURS = np.array(list(itertools.product((-1, 0, 1), repeat=3)))


@dataclass(frozen=True, eq=False)
class Highest:
    """The largest value of a function on the fine grid, and the poses (K, 3) of that grid that have it, (u, v, theta)
    in the order of v, u, theta."""

    value: float
    poses: np.ndarray


class RobustFunction:
    """E[f(q_hat)], f: (33, 44, 6). PlanningError for another f, or where a function of the pose gives no covariance."""

    def __init__(self, f: np.ndarray, uncertainty: PoseUncertainty):
        check_function(f)
        self.f, self.uncertainty = f, uncertainty

    @functools.cached_property
    def on_q(self) -> np.ndarray:
        """(33, 44, 6) at the poses of Q."""
        if self.uncertainty.sigmas is not None:
            return smooth(self.f, self.uncertainty.sigmas)
        if self.uncertainty.varies:
            return self.at(grid.poses().reshape(-1, 3)).reshape(grid.SHAPE)
        return self._coupled.on_q()

    @functools.cached_property
    def _coupled(self) -> Coupled:
        return Coupled(self.f, self.uncertainty.covariance_at(np.zeros(3)))

    def at(self, q: np.ndarray) -> np.ndarray:
        """(P,) at poses (P, 3) in (u, v, theta)."""
        q = np.asarray(q, dtype=float)
        if self.uncertainty.varies:
            return self._each_with_its_own(q)
        if self.uncertainty.sigmas is None:
            return self._coupled.at_index(grid.to_index(q))
        return robust_values(self.f, self.uncertainty.sigmas, q)

    def _each_with_its_own(self, q: np.ndarray) -> np.ndarray:
        covariances = np.stack([self.uncertainty.covariance_at(pose) for pose in q]).reshape(-1, 9)
        different, which = np.unique(covariances, axis=0, return_inverse=True)
        values = np.empty(len(q))
        for k, covariance in enumerate(different):
            of_it = np.flatnonzero(which == k)
            smoothed = RobustFunction(self.f, PoseUncertainty(covariance.reshape(3, 3)))
            few = smoothed.uncertainty.sigmas is None and len(of_it) < FEW
            values[of_it] = smoothed._coupled.at_few(grid.to_index(q[of_it])) if few else smoothed.at(q[of_it])
        return values

    def highest(self, plan: Plan) -> Highest | None:
        """The maximum on the fine grid; None where it is not above 0.

        Where errors do not correlate it is exactly that. Elsewhere it is searched for: of 480 networks' functions and
        full covariances (`benchmarks/planning.py`) one came out too low, by 4e-4.
        """
        if self.on_q.max() <= 0 and self.f.max() <= 0:
            return None
        separable = self.uncertainty.sigmas is not None
        found = self._highest_of_product(plan) if separable else self._highest_by_search(plan)
        return found if found.value > 0 else None

    def between(self, q: np.ndarray, plan: Plan) -> np.ndarray:
        """Pose q (3,) of the fine grid moved within half of its steps to the top of a parabola along each axis.

        q itself where that is no higher, as on a plateau.
        """
        steps = np.array([grid.CELL_M / plan.fine_uv, grid.CELL_M / plan.fine_uv, grid.CELL_RAD / plan.fine_theta])
        here, *around = self.at(np.concatenate([q[None], q + np.diag(steps), q - np.diag(steps)]))
        after, before = np.reshape(around, (2, 3))
        bend = before - 2 * here + after
        top = np.divide(before - after, 2 * bend, out=np.zeros(3), where=bend < 0).clip(-0.5, 0.5)
        edge = np.array([(n - 1) / 2 * grid.CELL_M for n in (grid.SHAPE[1], grid.SHAPE[0])])
        moved = q + top * steps
        moved = np.append(moved[:2].clip(-edge, edge), moved[2] % np.pi)
        return moved if self.at(moved[None]).item() > here * (1 + TIE) else q

    def _highest_of_product(self, plan: Plan) -> Highest:
        """Exactly that of the full fine grid: no value between vertices exceeds the largest of theirs by more than
        `gain` along each axis."""
        sigmas = self.uncertainty.sigmas
        assert sigmas is not None
        fine = plan.fine_uv, plan.fine_uv, plan.fine_theta
        cells = sigmas[[1, 0, 2]] / [grid.CELL_M, grid.CELL_M, grid.CELL_RAD]
        most = np.prod([gain(float(sigma), n) for sigma, n in zip(cells, fine, strict=True)])
        room = most * self.on_q >= (1 - 2 * TIE) * self.on_q.max()
        if self.f.min() < 0:
            room[...] = True
        axes = []
        for axis, (values, n) in enumerate(zip(fine_axes(plan.fine_uv, plan.fine_theta), fine, strict=True)):
            rows = room.any(axis=tuple({0, 1, 2} - {axis}))
            step = np.arange(len(values))
            axes.append(values[rows[step // n] | rows[-(-step // n) % len(rows)]])
        values = robust_function_at(self.f, sigmas, *axes)
        best = values.max()
        ties = np.unravel_index(np.flatnonzero(values >= best - TIE * abs(best)), values.shape)
        v, u, theta = (axis[index] for axis, index in zip(axes, ties, strict=True))
        return Highest(float(best), np.stack([u, v, theta], axis=-1))

    def _highest_by_search(self, plan: Plan) -> Highest:
        """From a few places that are far apart and good, by halves of a cell and then by steps of the fine grid."""
        fine = np.array([plan.fine_uv, plan.fine_uv, plan.fine_theta])
        known: dict[tuple[int, ...], float] = {}
        for start in self._starts(fine):
            for step in (np.maximum(fine // 2, 1), np.ones(3, dtype=int)):
                start = self._climb(start, step, fine, known)
        best = max(known.values())
        ties = sorted(at for at, value in known.items() if value >= best - TIE * abs(best))
        return Highest(best, grid.from_index(np.array(ties) / fine))

    def _starts(self, fine: np.ndarray) -> list[np.ndarray]:
        """The best poses of Q, and of half a cell on where that is cheap and the function not smooth without, each more
        than half a cell from better ones.

        Steps (3,) of the fine grid along v, u and theta.
        """
        halves = itertools.product(*(sorted({0, int(n) // 2}) for n in fine))
        smooth_ = not self.uncertainty.varies and self._coupled.smooths
        shifts = [(0, 0, 0)] if self.uncertainty.varies or smooth_ else list(halves)
        at, values = [], []
        for shift in shifts:
            here = self._coupled.on_q(tuple(shift / fine)) if any(shift) else self.on_q
            inside = here[: len(here) - bool(shift[0]), : here.shape[1] - bool(shift[1])]
            best = np.argpartition(-inside, STARTS, axis=None)[:STARTS]
            at.append(np.stack(np.unravel_index(best, inside.shape), axis=-1) * fine + shift)
            values.append(inside.ravel()[best])
        places, found = np.concatenate(at), np.concatenate(values)
        starts: list[np.ndarray] = []
        share = SHARE_OF_Q if self.uncertainty.varies else SHARE
        most = STARTS_WHERE_SMOOTH if smooth_ else MOST_STARTS
        for k in np.lexsort((*places.T[::-1], -found)):
            if len(starts) == most or found[k] < share * found.max():
                break
            apart = [np.abs(places[k] - start) for start in starts]
            turns = fine[2] * grid.SHAPE[2]
            if all((np.array([d[0], d[1], min(d[2], turns - d[2])]) > fine // 2).any() for d in apart):
                starts.append(places[k])
        return starts

    def _climb(
        self, start: np.ndarray, step: np.ndarray, fine: np.ndarray, known: dict[tuple[int, ...], float]
    ) -> np.ndarray:
        """From start (3,) to the best of its 26 neighbours and on, until none is better. Adds to what is known."""
        size = (np.array(grid.SHAPE) - [1, 1, 0]) * fine + [1, 1, 0]
        while True:
            around = start + NEIGHBOURS * step
            around = around[((around[:, :2] >= 0) & (around[:, :2] < size[:2])).all(axis=1)]
            around[:, 2] %= size[2]
            places = [tuple(place) for place in around.tolist()]
            new = [place for place in dict.fromkeys(places) if place not in known]
            if new:
                known.update(zip(new, self.at(grid.from_index(np.array(new) / fine)).tolist(), strict=True))
            best = min(places, key=lambda place: (-known[place], place))
            if known[best] <= known[tuple(start.tolist())]:
                return start
            start = np.array(best)


@functools.lru_cache(maxsize=64)
def gain(sigma: float, fine: int) -> float:
    """How many times the mean of two vertices' smoothed values, by distance, one between them can be; in cells.

    The smoothed values are sums of scores, none negative, times what a vertex weighs: the bound is the largest ratio of
    weights, and bounds of axes multiply. Far from its vertex a weight is convex, and the ratio below 1.
    """
    between = np.arange(fine + 1)[:, None] / fine
    vertices = np.arange(-4 - int(2 * min(sigma, 20)), 6 + int(2 * min(sigma, 20)))
    ends = (1 - between) * hat_weights(vertices, sigma) + between * hat_weights(1 - vertices, sigma)
    inside = hat_weights(between - vertices, sigma)
    return float(np.max(np.divide(inside, ends, out=np.ones_like(inside), where=ends > 0), initial=1.0))
