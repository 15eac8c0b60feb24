"""What a depth image shows of the table: every planner, network and figure looks at an image through this one door.

Where the camera stands is found in the image or believed, and from there the height map and the network's input follow.
"""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass

import numpy as np

from graspfn.geometry.transforms import rotation_z, translation
from graspfn.imaging.camera import Camera
from graspfn.imaging.height_map import HeightMap, height_map
from graspfn.imaging.holes import check_image, fill_holes
from graspfn.imaging.network_input import check_papers, depth_input, height_map_input
from graspfn.imaging.table import TableFit, fit_table
from graspfn.params import Table


@dataclass(frozen=True, eq=False)
class Sight:
    """A depth image, and where the camera stands over the table that it shows.

    kind: `network.*.input` of the network that looks. depth: (height, width), metres; beside `view`, (height, width)
    bool, the bare table. table: what its fit found, None where the camera's pose was believed.
    """

    kind: str
    depth: np.ndarray
    camera: Camera
    table: TableFit | None
    view: np.ndarray | None = None

    @functools.cached_property
    def seen(self) -> HeightMap:
        return height_map(self.depth, self.camera)

    @functools.cached_property
    def inputs(self) -> np.ndarray:
        """(channels, 132, 176) float32: one of the depth image with its holes filled, or two of the height map.

        DepthError where holes cannot be filled.
        """
        if self.kind == "depth":
            return depth_input(fill_holes(self.depth, self.camera), self.camera)[None]
        return height_map_input(self.seen)


def look(
    depth: np.ndarray,
    camera: Camera,
    kind: str,
    table: Table,
    *,
    posed: bool = True,
    view: np.ndarray | None = None,
) -> Sight:
    """depth: (height, width), metres, as the camera gives it; kind: `network.*.input`.

    depth: the camera's pose is believed, and has to be the paper's. height_map: the table is found in the image, if
    `table.fit` says so or the camera's pose is not known (`posed`); then the world's origin is where the optical axis
    meets the table, and u the image's x on it. view: (height, width) bool, the pixels that count; the table is found in
    all of them. DepthError or TableError says in one line why an image cannot be planned on.
    """
    check_image(depth, camera)
    fit = None
    if kind == "depth":
        check_papers(camera)
    elif not posed:
        fit = _over_the_axis(fit_table(depth, camera, dataclasses.replace(table, max_offset_mm=np.inf)))
    elif table.fit:
        fit = fit_table(depth, camera, table)
    if fit:
        camera = camera.at(fit.T_world_camera)
    if view is not None:
        depth = np.where(view, depth, camera.bare_table()).astype(np.float32)
    return Sight(kind, depth, camera, fit, view)


def _over_the_axis(fit: TableFit) -> TableFit:
    """The same with the world's origin where the optical axis meets the table, and +u along the image's x on it."""
    T = rotation_z(-np.arctan2(fit.T_world_camera[1, 0], fit.T_world_camera[0, 0])) @ fit.T_world_camera
    ahead = T[:3, 2]
    x, y, _ = T[:3, 3] + ahead * (T[2, 3] / -ahead[2])
    return dataclasses.replace(fit, T_world_camera=translation(-x, -y) @ T)
