"""The gripper's pose uncertainty Sigma: where it arrives when it is sent to a pose (paper VI)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from graspfn.planning.smoothing import check_sigma


@dataclass(frozen=True)
class PoseUncertainty:
    """Sigma = diag(sigma_uv^2, sigma_uv^2, sigma_theta^2): metres and radians. PlanningError unless both are finite
    and at least 0."""

    uv_m: float
    theta_rad: float

    def __post_init__(self) -> None:
        check_sigma(self.uv_m, self.theta_rad)

    @classmethod
    def of(cls, uv_mm: float, theta_deg: float) -> PoseUncertainty:
        """From people's units."""
        return cls(uv_mm / 1e3, float(np.radians(theta_deg)))

    @property
    def spreads(self) -> bool:
        """Whether no direction is certain, so that there is a density."""
        return self.uv_m > 0 and self.theta_rad > 0

    @property
    def covariance(self) -> np.ndarray:
        """(3, 3) of (u [m], v [m], theta [rad])."""
        return np.diag([self.uv_m, self.uv_m, self.theta_rad]) ** 2

    @property
    def name(self) -> str:
        """In people's units: (5 mm, 10°)."""
        return f"({1e3 * self.uv_m:g} mm, {np.degrees(self.theta_rad):g}°)"

    def reached(self, q: np.ndarray, errors: np.ndarray) -> np.ndarray:
        """Poses (..., 3) reached when sent to q (3,), theta wrapped to [0, pi); errors: (..., 3) standard normal."""
        reached = q + np.asarray(errors) * [self.uv_m, self.uv_m, self.theta_rad]
        reached[..., 2] %= np.pi
        return reached
