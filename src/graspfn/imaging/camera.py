"""The depth camera: a pinhole above the image centre, optical axis along the table's normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from graspfn.geometry.grid import CELL_M, CELL_PX
from graspfn.params import Camera


@dataclass(frozen=True)
class Intrinsics:
    """Pinhole intrinsics; integer pixel coordinates are pixel centres, (0, 0) top left."""

    width: int
    height: int
    focal: float

    @classmethod
    def from_params(cls, camera: Camera) -> Intrinsics:
        return cls(camera.width_px, camera.height_px, camera.focal_px)

    @property
    def centre(self) -> np.ndarray:
        """Principal point (x, y), px: the image's centre."""
        return np.array([(self.width - 1) / 2, (self.height - 1) / 2])

    @property
    def table_depth(self) -> float:
        """Height of the camera above the table, metres: 14 px span 10 mm there."""
        return self.focal * CELL_M / CELL_PX

    @property
    def matrix(self) -> np.ndarray:
        """K: (3, 3)."""
        cx, cy = self.centre
        return np.array([[self.focal, 0, cx], [0, self.focal, cy], [0, 0, 1.0]])

    def rays(self) -> np.ndarray:
        """Directions (height, width, 3) of unit depth through the pixel centres, in world axes."""
        x, y = np.meshgrid(np.arange(self.width), np.arange(self.height))
        cx, cy = self.centre
        return np.stack([(x - cx) / self.focal, -(y - cy) / self.focal, -np.ones_like(x, dtype=float)], axis=-1)

    def table_to_pixel(self, uv: np.ndarray) -> np.ndarray:
        """Pixels (..., 2) of points (u, v) (..., 2) on the table, metres from the image centre."""
        return self.centre + np.asarray(uv) * (CELL_PX / CELL_M)

    def pixel_to_table(self, pixel: np.ndarray) -> np.ndarray:
        """Inverse of `table_to_pixel`."""
        return (np.asarray(pixel) - self.centre) * (CELL_M / CELL_PX)

    def deproject(self, depth: np.ndarray) -> np.ndarray:
        """World points (height, width, 3), metres, of a depth image (height, width), metres."""
        return self.rays() * depth[..., None] + [0.0, 0.0, self.table_depth]
