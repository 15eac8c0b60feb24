"""The gripper's pose uncertainty Sigma: where it arrives when it is sent to a pose (paper VI)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

AXES = ("u", "v", "theta")
UNITS = ("m", "m", "rad")
MOST = 1e12  # m and rad, of a standard deviation: far beyond uniform, and powers of it are still numbers
ROUNDING = 1e-9  # of a covariance, in units of its standard deviations: what files with nine digits leave


class PlanningError(ValueError):
    """A grasp function or an uncertainty that no pose can be planned with: one line that says why."""


def check_sigmas(sigmas: ArrayLike) -> np.ndarray:
    """(3,) standard deviations of u [m], v [m] and theta [rad], of (sigma_uv, sigma_theta) or all three.

    PlanningError names the one that is none.
    """
    values = np.asarray(sigmas, dtype=float)
    names = ("uv", "theta") if values.size == 2 else AXES
    for name, value in zip(names, values, strict=True):
        if not 0 <= value <= MOST:
            unit = "rad" if name == "theta" else "m"
            raise PlanningError(f"sigma_{name}: is {value:g} {unit}; it takes a finite number of at least 0")
    return values[[0, 0, 1]] if values.size == 2 else values


def check_covariance(covariance: ArrayLike, at: str = "") -> np.ndarray:
    """(3, 3) float64, if it is the covariance of (u [m], v [m], theta [rad]); PlanningError says what it is instead."""
    try:
        matrix = np.array(covariance, dtype=float)
    except (TypeError, ValueError):
        raise PlanningError(f"covariance{at}: takes 3 x 3 numbers, of u, v and theta") from None
    if matrix.shape != (3, 3):
        raise PlanningError(f"covariance{at}: has the shape {matrix.shape}; it takes (3, 3), of u, v and theta")
    if bad := int((~np.isfinite(matrix)).sum()):
        raise PlanningError(f"covariance{at}: {bad} of its 9 numbers are NaN or infinite")
    for axis, unit, variance in zip(AXES, UNITS, np.diag(matrix), strict=True):
        if not 0 <= variance <= MOST**2:
            takes = "at least 0" if variance < 0 else f"up to {MOST**2:g}"
            raise PlanningError(f"covariance{at}: the variance of {axis} is {variance:g} {unit}^2; it takes {takes}")
    scale = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    if (abs(matrix - matrix.T) > ROUNDING * scale).any():
        raise PlanningError(f"covariance{at}: not symmetric; it takes the same above and below its diagonal")
    matrix = (matrix + matrix.T) / 2
    correlation = np.divide(matrix, scale, out=np.where(matrix == 0, 0.0, np.inf), where=scale > 0)
    if np.isinf(correlation).any() or (least := float(np.linalg.eigvalsh(correlation)[0])) < -ROUNDING:
        why = "an axis without variance varies with another" if np.isinf(correlation).any() else f"by {-least:.3g}"
        raise PlanningError(f"covariance{at}: not positive semi-definite ({why}), so that no errors have it")
    return matrix


class PoseUncertainty:
    """Sigma of q_hat ~ N(q, Sigma), in metres and radians.

    sigma: (sigma_uv, sigma_theta); (sigma_u, sigma_v, sigma_theta); a covariance (3, 3) of (u, v, theta), which may be
    singular; or a function of the commanded pose (3,) that gives one. PlanningError says what is none.
    """

    def __init__(self, sigma: ArrayLike | Callable[[np.ndarray], ArrayLike]):
        self._of_pose = sigma if callable(sigma) else None
        self._covariance: np.ndarray | None = None
        self._sigmas: np.ndarray | None = None  # where nothing correlates; kept, since roots of squares round
        if callable(sigma):
            return
        if isinstance(sigma, list | tuple | np.ndarray) and len(sigma) in (2, 3) and not any(map(np.ndim, sigma)):
            self._sigmas = check_sigmas(sigma)
            self._covariance = np.diag(self._sigmas**2)
            return
        self._covariance = check_covariance(sigma)
        if not (self._covariance - np.diag(np.diag(self._covariance))).any():
            self._sigmas = np.sqrt(np.diag(self._covariance))

    @classmethod
    def of(cls, uv_mm: float, theta_deg: float) -> PoseUncertainty:
        """From people's units."""
        return cls((uv_mm / 1e3, float(np.radians(theta_deg))))

    @property
    def varies(self) -> bool:
        """Whether Sigma is a function of the pose."""
        return self._of_pose is not None

    @property
    def sigmas(self) -> np.ndarray | None:
        """(3,) standard deviations of u, v and theta; None where they correlate, or vary with the pose."""
        return self._sigmas

    @property
    def spreads(self) -> bool:
        """Whether no axis is certain, so that errors which do not correlate have a density."""
        return self._sigmas is not None and bool((self._sigmas > 0).all())

    def covariance_at(self, q: np.ndarray) -> np.ndarray:
        """(3, 3) of the errors when sent to pose q (3,)."""
        if self._of_pose is None:
            assert self._covariance is not None
            return self._covariance
        u, v, theta = q
        return check_covariance(self._of_pose(np.array(q, dtype=float)), f" at ({u:.3f} m, {v:.3f} m, {theta:.3f} rad)")

    def reached(self, q: np.ndarray, errors: np.ndarray) -> np.ndarray:
        """Poses (..., 3) reached when sent to q (3,), theta wrapped to [0, pi); errors: (..., 3) standard normal."""
        if self._sigmas is not None:
            reached = q + np.asarray(errors) * self._sigmas
        else:
            variances, axes = np.linalg.eigh(self.covariance_at(q))
            reached = q + np.asarray(errors) @ (axes * np.sqrt(variances.clip(0))).T
        reached[..., 2] %= np.pi
        return reached
