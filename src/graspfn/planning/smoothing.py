"""The robust grasp function (paper VI): f with the gripper's pose uncertainty marginalised out, at any pose.

The grasp function is known at the poses of Q. Between them it is taken as trilinear, outside Q's extents in (u, v)
it falls to 0 within one cell (a pose that was never tested is not one to rely on), and theta wraps at a half turn.
The arm reaches q_hat ~ N(q, Sigma), so the expected score of commanding q is E[f(q_hat)]. Where Sigma is
diag(su^2, sv^2, stheta^2), which is what is here, a trilinear interpolant's expectation is exact and separable: along
each axis a vertex k weighs E[hat(X - k)], hat(t) = max(0, 1 - |t|), X ~ N(x, sigma^2). `planning/coupled.py` has any
other Sigma.

The paper smooths at the poses of Q, interpolates trilinearly and takes the maximum. The maximum of a trilinear
interpolant always lies on a vertex, so that last step never moves the pose; interpolating before smoothing does.
The smoothed function itself is therefore evaluated between the poses of Q (`params.Plan`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr

from graspfn.geometry import grid
from graspfn.planning.uncertainty import PlanningError, check_sigmas

# In cells of theta. Wrapped on six cells, so wide a Gaussian is uniform to the last bit: exp(-2 (10 pi / 6)^2) < 1e-23.
UNIFORM_SIGMA = 10.0


def check_function(f: np.ndarray) -> None:
    """PlanningError unless f is a grasp function: (33, 44, 6) finite numbers."""
    if f.shape != grid.SHAPE or f.dtype.kind not in "fiub":
        raise PlanningError(f"grasp function: is {f.dtype} of shape {f.shape}; it takes numbers of shape {grid.SHAPE}")
    bad = int(f.size - np.isfinite(f).sum())
    if bad:
        raise PlanningError(f"grasp function: {bad} of its {f.size} scores are NaN or infinite")


def _mean_excess(distance: np.ndarray, sigma: float) -> np.ndarray:
    """E[max(0, distance + sigma Z)] (...), Z standard normal; max(0, distance) where sigma is 0."""
    if sigma == 0:
        return np.maximum(distance, 0.0)
    with np.errstate(over="ignore"):  # so many sigmas away that nothing of the density is left
        z = distance / sigma
        return distance * ndtr(z) + sigma * np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)


def hat_weights(offset: np.ndarray, sigma: float) -> np.ndarray:
    """E[max(0, 1 - |offset + sigma Z|)] (...): offset and sigma in cells; hat is a second difference of max(0, .)."""
    # Symmetric in the offset; the negative side avoids subtracting large numbers.
    left = -np.abs(offset)
    right, middle, beyond = _mean_excess(np.stack([left + 1, left, left - 1]), sigma)
    weights = right - 2 * middle + beyond
    return np.maximum(weights, 0.0)


def axis_weights(at: np.ndarray, vertices: int, sigma: float) -> np.ndarray:
    """(len(at), vertices) weights of the vertices 0..vertices-1 for positions `at`; all in cells."""
    return hat_weights(np.asarray(at)[:, None] - np.arange(vertices), sigma)


def wrapped_weights(at: np.ndarray, vertices: int, sigma: float) -> np.ndarray:
    """`axis_weights` on a circle of `vertices` cells: the sum over all turns, so that rows sum to 1."""
    sigma = min(sigma, UNIFORM_SIGMA)
    turns = int(np.ceil((8 * sigma + 1) / vertices))
    offset = np.mod(np.asarray(at), vertices)[:, None, None] - np.arange(vertices)
    return hat_weights(offset + np.arange(-turns, turns + 1)[:, None] * vertices, sigma).sum(axis=1)


def robust_function_at(f: np.ndarray, sigmas: ArrayLike, v: np.ndarray, u: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """E[f(q_hat)] (len(v), len(u), len(theta)) float64 on the product of v, u [m] and theta [rad]; f: (33, 44, 6).

    sigmas: (sigma_uv, sigma_theta) or (sigma_u, sigma_v, sigma_theta), metres and radians. Raises PlanningError for
    another f and for a sigma that is negative, NaN or infinite.
    """
    check_function(f)
    along_v, along_u, along_theta = _weights(sigmas, v, u, theta)
    smooth_v = np.tensordot(along_v, np.asarray(f, dtype=float), axes=(1, 0))
    smooth_vu = np.einsum("vjt,uj->vut", smooth_v, along_u, optimize=True)
    return smooth_vu @ along_theta.T


def robust_values(f: np.ndarray, sigmas: ArrayLike, q: np.ndarray) -> np.ndarray:
    """E[f(q_hat)] (P,) at poses (P, 3) in (u [m], v [m], theta [rad]); else as `robust_function_at`."""
    check_function(f)
    along_v, along_u, along_theta = _weights(sigmas, q[:, 1], q[:, 0], q[:, 2])
    smooth_v = np.tensordot(along_v, np.asarray(f, dtype=float), axes=(1, 0))
    return np.sum((along_u[:, None] @ smooth_v)[:, 0] * along_theta, axis=1)


def _weights(
    sigmas: ArrayLike, v: np.ndarray, u: np.ndarray, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What each vertex along v, u and theta weighs at these positions: (len(v), 33), (len(u), 44), (len(theta), 6)."""
    sigma_u, sigma_v, sigma_theta = check_sigmas(sigmas)
    n_v, n_u, n_theta = grid.SHAPE
    return (
        axis_weights(np.asarray(v) / grid.CELL_M + (n_v - 1) / 2, n_v, sigma_v / grid.CELL_M),
        axis_weights(np.asarray(u) / grid.CELL_M + (n_u - 1) / 2, n_u, sigma_u / grid.CELL_M),
        wrapped_weights(np.asarray(theta) / grid.CELL_RAD, n_theta, sigma_theta / grid.CELL_RAD),
    )


def smooth(f: np.ndarray, sigmas: ArrayLike) -> np.ndarray:
    """The robust grasp function (33, 44, 6) at the poses of Q; f itself where all sigmas are 0."""
    return robust_function_at(f, sigmas, *grid.axes())


def fine_axes(fine_uv: int, fine_theta: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """v, u [m] and theta [rad] refined so many times per cell, within Q's extents; every pose of Q is among them."""
    n_v, n_u, n_theta = grid.SHAPE
    index_v = np.linspace(0, n_v - 1, (n_v - 1) * fine_uv + 1)
    index_u = np.linspace(0, n_u - 1, (n_u - 1) * fine_uv + 1)
    v = (index_v - (n_v - 1) / 2) * grid.CELL_M
    u = (index_u - (n_u - 1) / 2) * grid.CELL_M
    return v, u, np.arange(n_theta * fine_theta) / fine_theta * grid.CELL_RAD
