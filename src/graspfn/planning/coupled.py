"""The robust grasp function (paper VI) where errors of position and angle go together: any covariance, also singular.

Errors along theta are those that go with the position, and a rest that does not: theta = B (u, v) + N(0, s^2). The
rest is smoothed exactly, as in `planning/smoothing.py`. Over the errors in (u, v) runs a sum: along each of their two
principal axes strips of equal width, each at its mean and with its probability. Scores change over a cell, so a strip
is a third of a cell wide, or a cell where errors are wide; what leaves Q from wherever the gripper is sent is left out.
"""

from __future__ import annotations

import functools

import numpy as np
from scipy import fft
from scipy.special import ndtr

from graspfn.geometry import grid
from graspfn.planning.smoothing import wrapped_weights

REACH = 4.0  # standard deviations: what is further out has a probability of 6e-5
STRIPS_A_CELL = 3.0
# Strips along an axis. Under wide errors a strip may be a cell, if there are MANY of them: functions of networks then
# are off by 5e-4 at most.
FEWEST, MANY, MOST = 24, 48, 1024
CERTAIN = 1e-4  # cells: a micrometre
ANGLES = 24  # per cell of theta: it turns between them as if scores were linear there, which they are where s is 0
FEW = 6  # poses for which it does not pay to smooth all of f along theta
N_V, N_U, N_THETA = grid.SHAPE
FFT_AXES = (2, 0, 1)
CELLS = np.array([grid.CELL_M, grid.CELL_M, grid.CELL_RAD])  # of v, u, theta


def in_cells(covariance: np.ndarray) -> np.ndarray:
    """(3, 3) of (u, v, theta), metres and radians -> of (v, u, theta), the axes of a grasp function, in cells."""
    return covariance[np.ix_([1, 0, 2], [1, 0, 2])] / np.outer(CELLS, CELLS)


def _strips(sigma: float, alone: bool) -> tuple[np.ndarray, np.ndarray]:
    """Offsets (n,) in cells, and their probabilities, of errors along one axis; alone: the other one is certain."""
    if sigma <= CERTAIN:
        return np.zeros(1), np.ones(1)
    reach = min(REACH, float(np.hypot(N_V, N_U)) / sigma)
    across = 2 * reach * sigma
    most = MOST if alone else max(MANY, int(np.ceil(across)))
    n = int(np.clip(np.ceil(across * STRIPS_A_CELL), FEWEST, most))
    edges = np.linspace(-reach, reach, n + 1)
    mass = np.diff(ndtr(edges))
    means = -np.diff(np.exp(-0.5 * edges**2)) / np.sqrt(2 * np.pi) / mass
    return means * sigma, mass / mass.sum() if reach == REACH else mass


def _errors(covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Errors (N, 3) in (v, u, theta) and their probabilities (N,), and the s of what is left of theta; all in cells."""
    variances, axes = np.linalg.eigh(covariance[:2, :2])
    sigmas = np.sqrt(variances.clip(0))
    alone = bool((sigmas <= CERTAIN).any())
    (one, weights_one), (two, weights_two) = (_strips(float(sigma), alone) for sigma in sigmas)
    along = np.stack(np.meshgrid(one, two, indexing="ij"), axis=-1).reshape(-1, 2)
    weights = np.outer(weights_one, weights_two).ravel()
    errors = along @ axes.T
    inside = (np.abs(errors) < [N_V, N_U]).all(axis=1)
    shared = axes.T @ covariance[:2, 2]
    per_axis = np.divide(shared, variances, out=np.zeros(2), where=sigmas > CERTAIN)
    rest = np.sqrt(max(covariance[2, 2] - shared @ per_axis, 0.0))
    turns = (along @ per_axis) % N_THETA
    return np.column_stack([errors, turns])[inside], weights[inside], float(rest)


def _deposit(
    errors: np.ndarray, weights: np.ndarray, over_theta: np.ndarray, at: np.ndarray, shape: tuple[int, int]
) -> np.ndarray:
    """(shape, 6) weight of each vertex for a pose at index `at` (3,), theta of it and of errors (N, 3) in [0, 6).

    over_theta: (6 ANGLES + 1, 6) weights of the vertices at angles.
    """
    n_v, n_u = shape
    index = errors + at
    inside = ((index[:, :2] > -1) & (index[:, :2] < shape)).all(axis=1)
    (row, dv), (column, du), (angle, turn) = _cells(index[inside], len(over_theta) - 1)
    along = weights[inside, None] * ((1 - turn)[:, None] * over_theta[angle] + turn[:, None] * over_theta[angle + 1])
    total = np.zeros((n_v + 2) * (n_u + 2) * N_THETA)
    first = ((row + 1) * (n_u + 2) + column + 1)[:, None] * N_THETA + np.arange(N_THETA)
    for across, share in ((0, 1 - du), (N_THETA, du)):
        for down, of_it in ((0, 1 - dv), ((n_u + 2) * N_THETA, dv)):
            vertex = (first + (down + across)).ravel()
            total += np.bincount(vertex, ((share * of_it)[:, None] * along).ravel(), minlength=len(total))
    return total.reshape(n_v + 2, n_u + 2, N_THETA)[1:-1, 1:-1]


def _cells(index: np.ndarray, angles: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of indices (..., 3), theta of them in [0, 12), the vertices below and how far beyond; of theta among `angles`."""
    v, u, theta = np.moveaxis(index, -1, 0)
    theta = theta * (angles / N_THETA) % angles
    return [(low := np.floor(x).astype(np.intp), x - low) for x in (v, u, theta)]


def _means(padded: np.ndarray, errors: np.ndarray, weights: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(P,) weighted means over errors (N, 3) about indices at (P, 3), theta of both in [0, 6).

    padded: (36, 47, 6 ANGLES) complex, zeros all round, two of them at the upper ends: a value, and how much the next
    angle's is more. The neighbours of a pose share their v, u and theta, and so what errors make of each.
    """
    n_v, n_u, n_angles = padded.shape
    scores = padded.ravel()
    step = np.array([0, n_angles, n_u * n_angles, (n_u + 1) * n_angles])[:, None]  # to the four vertices around

    @functools.lru_cache(maxsize=64)
    def along(axis: int, value: float) -> tuple[np.ndarray, np.ndarray]:
        index = value + errors[:, axis]
        if axis == 2:
            index *= n_angles / N_THETA
            index %= n_angles
        else:
            index = (index + 1).clip(0, (n_v, n_u)[axis] - 2)  # what is further out has no score either
        low = np.floor(index).astype(np.intp)
        return low, index - low

    @functools.lru_cache(maxsize=16)  # a pose has nine
    def around(v: float, u: float) -> tuple[np.ndarray, np.ndarray]:
        (row, dv), (column, du) = along(0, v), along(1, u)
        low, high = weights * (1 - dv), weights * dv
        return (row * n_u + column) * n_angles + step, np.stack([low * (1 - du), low * du, high * (1 - du), high * du])

    def mean(v: float, u: float, theta: float) -> float:
        (first, share), (angle, turn) = around(v, u), along(2, theta)
        found = scores.take(first + angle)
        return float(np.sum(share * (found.real + turn * found.imag)))

    return np.array([mean(*pose) for pose in at.tolist()])


def _turned(index: np.ndarray) -> np.ndarray:
    """Indices (P, 3) with theta in [0, 6]."""
    index = np.array(index, dtype=float)
    index[:, 2] %= N_THETA
    return index


class Coupled:
    """f (33, 44, 6) smoothed with one covariance (3, 3) of (u, v, theta), metres and radians, checked."""

    def __init__(self, f: np.ndarray, covariance: np.ndarray):
        self.f = np.asarray(f, dtype=float)
        cells = in_cells(covariance)
        self._errors, self._weights, rest = _errors(cells)
        self._narrowest = float(np.sqrt(np.linalg.eigvalsh(cells[:2, :2])[0].clip(0)))
        self._over_theta = wrapped_weights(np.arange(N_THETA * ANGLES + 1) / ANGLES, N_THETA, rest)

    @functools.cached_property
    def _padded(self) -> np.ndarray:
        """(36, 47, 6 ANGLES) complex: f smoothed with what is left of theta and its steps, zeros all round."""
        smoothed = self.f @ self._over_theta.T
        padded = np.zeros((N_V + 3, N_U + 3, N_THETA * ANGLES), dtype=complex)
        padded.real[1:-2, 1:-2], padded.imag[1:-2, 1:-2] = smoothed[..., :-1], np.diff(smoothed)
        return padded

    @functools.cached_property
    def _spectrum(self) -> np.ndarray:
        """Of f, with as much room around it as the errors reach."""
        padded = np.zeros((*self._size, N_THETA))
        padded[:N_V, :N_U] = self.f
        return fft.rfftn(padded, axes=FFT_AXES)

    @property
    def smooths(self) -> bool:
        """Whether errors of position spread over more than a cell in every direction: no peak is between poses of Q."""
        return self._narrowest >= 1

    @property
    def _size(self) -> tuple[int, int]:
        r_v, r_u = self._reach
        return fft.next_fast_len(int(N_V + r_v)), fft.next_fast_len(int(N_U + r_u))

    @functools.cached_property
    def _reach(self) -> np.ndarray:
        """(2,) cells along v and u over which vertices weigh on a pose, or on one up to a cell further."""
        reach = np.ceil(np.abs(self._errors[:, :2]).max(axis=0)).astype(int) + 2
        return np.minimum(reach, [N_V - 1, N_U - 1])

    def on_q(self, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
        """(33, 44, 6) at the poses of Q, or at all of them shifted by a part of a cell in (v, u, theta).

        A correlation of f with the weights that the vertices around a pose have: by FFT, with room for their reach.
        """
        r_v, r_u = self._reach
        middle = np.array([r_v, r_u, 0]) + shift
        weights = _deposit(self._errors, self._weights, self._over_theta, middle, (2 * r_v + 1, 2 * r_u + 1))
        rolled = np.zeros((*self._size, N_THETA))
        rows, columns = np.arange(-r_v, r_v + 1), np.arange(-r_u, r_u + 1)
        rolled[rows[:, None], columns] = weights
        spectrum = self._spectrum * fft.rfftn(rolled, axes=FFT_AXES).conj()
        smoothed: np.ndarray = fft.irfftn(spectrum, (N_THETA, *self._size), axes=FFT_AXES)[:N_V, :N_U]
        return smoothed

    def at_index(self, index: np.ndarray) -> np.ndarray:
        """(P,) at grid coordinates (P, 3) in (v, u, theta)."""
        return _means(self._padded, self._errors, self._weights, _turned(index))

    def at_few(self, index: np.ndarray) -> np.ndarray:
        """The same, for so few poses that it does not pay to smooth all of f along theta."""
        kernels = (_deposit(self._errors, self._weights, self._over_theta, at, (N_V, N_U)) for at in _turned(index))
        return np.array([np.sum(kernel * self.f) for kernel in kernels])
