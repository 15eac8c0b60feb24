"""The depth camera: size, intrinsic matrix, lens distortion, and where it stands over the table."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field

import cv2
import numpy as np

from graspfn.geometry.grid import CELL_M, CELL_PX
from graspfn.geometry.transforms import apply
from graspfn.params import Camera as CameraParams

PAPER_HEIGHT_M = 570 * CELL_M / CELL_PX  # the Carmine's focal length, and 14 px that span 10 mm of the table
NEAR_M = 0.01  # nothing nearer to the camera is rendered, and nothing nearer is a measurement
# OpenCV inverts distortion by iteration, and stops after five rounds unless told: 0.1 px off at the corners of a lens.
INVERSE = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12)


def straight_down(height_m: float) -> np.ndarray:
    """T_world_camera (4, 4) of a camera `height_m` over the world's origin: x = +u, y = +v, looking along -z."""
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[2, 3] = height_m
    return T


@functools.lru_cache(maxsize=8)
def _rays(width: int, height: int, K: tuple[float, ...], distortion: tuple[float, ...]) -> np.ndarray:
    """(height, width, 3) directions of unit depth through the pixel centres, in camera axes; not to be written to."""
    fx, fy, cx, cy = K
    x, y = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    rays = np.stack([(x - cx) / fx, (y - cy) / fy, np.ones_like(x)], axis=-1)
    if any(distortion):
        pixels = np.stack([x, y], axis=-1).reshape(-1, 1, 2)
        seen = cv2.undistortPoints(pixels, _matrix(K), np.array(distortion), criteria=INVERSE)
        rays[..., :2] = seen.reshape(height, width, 2)
    rays.flags.writeable = False
    return rays


@functools.lru_cache(maxsize=8)
def _slopes(width: int, height: int, K: tuple[float, ...], distortion: tuple[float, ...]) -> np.ndarray:
    """x and y of `_rays`, (height, width, 2) float32."""
    slopes = np.ascontiguousarray(_rays(width, height, K, distortion)[..., :2], dtype=np.float32)
    slopes.flags.writeable = False
    return slopes


def _matrix(K: tuple[float, ...]) -> np.ndarray:
    fx, fy, cx, cy = K
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole with a lens; integer pixel coordinates are pixel centres, (0, 0) top left.

    K: fx, fy, cx, cy, px. distortion: in OpenCV's order, k1 k2 p1 p2 [k3 [k4 k5 k6]]; empty for none.
    T_world_camera: (4, 4), camera axes as OpenCV's: x right, y down, z along the optical axis. Depth is along z.
    """

    width: int
    height: int
    K: tuple[float, float, float, float]
    distortion: tuple[float, ...] = ()
    T_world_camera: np.ndarray = field(default_factory=lambda: straight_down(PAPER_HEIGHT_M))

    @classmethod
    def from_params(cls, camera: CameraParams) -> Camera:
        K = camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
        T = straight_down(camera.height_mm / 1000)
        if camera.pose is not None:
            T = np.array(camera.pose).reshape(4, 4)
        return cls(camera.width_px, camera.height_px, K, camera.distortion or (), T)

    @classmethod
    def of_the_paper(cls, width: int, height: int, focal: float) -> Camera:
        """Looks straight down from where 14 px span 10 mm of the table, the image's centre in its axis."""
        K = focal, focal, (width - 1) / 2, (height - 1) / 2
        return cls(width, height, K, (), straight_down(focal * CELL_M / CELL_PX))

    def at(self, T_world_camera: np.ndarray) -> Camera:
        """The same camera elsewhere."""
        return Camera(self.width, self.height, self.K, self.distortion, T_world_camera)

    @property
    def matrix(self) -> np.ndarray:
        """(3, 3)."""
        return _matrix(self.K)

    @property
    def distorts(self) -> bool:
        return any(self.distortion)

    @property
    def position(self) -> np.ndarray:
        """(3,) of the lens, in the world."""
        return self.T_world_camera[:3, 3]

    @property
    def centre(self) -> np.ndarray:
        """Principal point (x, y), px."""
        return np.array(self.K[2:])

    @property
    def table_depth(self) -> float:
        """Distance to the table along the optical axis, metres: the height of a camera that looks straight down."""
        return float(self.position[2] / -self.T_world_camera[2, 2])

    @property
    def tilt(self) -> float:
        """Angle between the optical axis and straight down, radians."""
        return float(np.arccos(np.clip(-self.T_world_camera[2, 2], -1, 1)))

    def camera_rays(self) -> np.ndarray:
        """Directions (height, width, 3) of unit depth through the pixel centres, in camera axes."""
        return _rays(self.width, self.height, self.K, self.distortion)

    def slopes(self) -> np.ndarray:
        """x and y of `camera_rays`, (height, width, 2) float32: what the fast loops read."""
        return _slopes(self.width, self.height, self.K, self.distortion)

    def rays(self) -> np.ndarray:
        """Directions (height, width, 3) of unit depth through the pixel centres, in world axes."""
        return self.camera_rays() @ self.T_world_camera[:3, :3].T

    def bare_table(self) -> np.ndarray:
        """(height, width) float64: the depth image of the bare table, inf where a pixel looks past it."""
        down = -self.rays()[..., 2]
        with np.errstate(divide="ignore"):
            return np.where(down > 0, self.position[2] / down, np.inf)

    def deproject(self, depth: np.ndarray) -> np.ndarray:
        """World points (height, width, 3), metres, of a depth image (height, width), metres."""
        return self.rays() * depth[..., None] + self.position

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels (..., 2) and depths, stacked to (..., 3), of world points (..., 3); a point behind has depth < 0."""
        seen = apply(np.linalg.inv(self.T_world_camera), np.asarray(points, dtype=float))
        if self.distorts:
            flat = np.ascontiguousarray(seen.reshape(-1, 1, 3))
            pixels, _ = cv2.projectPoints(flat, np.zeros(3), np.zeros(3), self.matrix, np.array(self.distortion))
            pixels = pixels.reshape(*seen.shape[:-1], 2)
        else:
            fx, fy, cx, cy = self.K
            with np.errstate(divide="ignore", invalid="ignore"):
                pixels = seen[..., :2] / seen[..., 2:] * [fx, fy] + [cx, cy]
        return np.concatenate([pixels, seen[..., 2:]], axis=-1)

    def table_to_pixel(self, uv: np.ndarray) -> np.ndarray:
        """Pixels (..., 2) of points (u, v) (..., 2) on the table, metres from the world's origin."""
        uv = np.asarray(uv, dtype=float)
        return self.project(np.stack([uv[..., 0], -uv[..., 1], np.zeros(uv.shape[:-1])], axis=-1))[..., :2]

    def pixel_to_table(self, pixel: np.ndarray) -> np.ndarray:
        """Inverse of `table_to_pixel`."""
        pixel = np.asarray(pixel, dtype=float)
        seen = cv2.undistortPoints(pixel.reshape(-1, 1, 2), self.matrix, np.array(self.distortion), criteria=INVERSE)
        rays = np.concatenate([seen[:, 0], np.ones((len(seen), 1))], axis=-1) @ self.T_world_camera[:3, :3].T
        points = self.position + rays * (self.position[2] / -rays[:, 2:])
        return (points[:, :2] * [1, -1]).reshape(pixel.shape)
