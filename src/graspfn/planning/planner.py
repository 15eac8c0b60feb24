"""From a user's own depth image to the pose to command: table, height map, network, Sigma (paper VI).

Frames: q = (u, v, theta) lies on the table that is found in the image. The grasp's frame has its origin between the
fingertips, x closes the jaws, z points up from the table. With P the grasp, R the robot's base, G its gripper when the
image was taken, C the camera and I the table as the image shows it: T_RP = T_RG T_GC T_CI p.
"""

from __future__ import annotations

import dataclasses
import enum
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from graspfn.geometry.transforms import T_world_grasp, apply, rotation_z, translation
from graspfn.imaging.camera import Camera
from graspfn.imaging.height_map import CELL_M, HeightMap, height_map
from graspfn.imaging.holes import check_image, fill_holes
from graspfn.imaging.network_input import check_papers, depth_input, height_map_input
from graspfn.imaging.table import TableError, TableFit, fit_table
from graspfn.params import Gripper, Plan, Table, build
from graspfn.planning.centroid import centroid_grasp, object_mask
from graspfn.planning.methods import best_grasp
from graspfn.planning.model import FEWEST_PX, check_model
from graspfn.planning.objects import meets, whole_object
from graspfn.planning.robust import RobustFunction
from graspfn.planning.target import T_robot_target
from graspfn.planning.uncertainty import PlanningError, PoseUncertainty


class Method(enum.StrEnum):
    """How a pose is chosen (paper VII-A)."""

    ROBUST = "robust"
    BEST = "best"
    CENTROID = "centroid"


class Predictor(Protocol):
    """A network: input (channels, 132, 176) float32 -> scores (33, 44, 6) in [0, 1], and the likeliest classes
    (33, 44, 6), 0 to 5. Called from several threads at once."""

    def __call__(self, inputs: np.ndarray, /) -> tuple[np.ndarray, np.ndarray]: ...


@dataclass(frozen=True, eq=False)
class Grasp:
    """A pose to command, and what it was planned on.

    q: (3,) (u [m], v [m], theta [rad]) on the table, from the world's origin; z_m: of the fingertips over the table.
    pixel: (3,) (x [px], y [px], theta [rad]) in the image, of the point between the fingertips and of their closing.
    T_camera_grasp, T_robot_grasp: (4, 4); the second where the robot's frames were given.
    score: the grasp function at q; robust_score: with the errors of the arm, the success that the pose promises.
    function: the grasp function `f` that was planned on and its robust one, `on_q`, both (33, 44, 6).
    seen: the height map; camera: where it stands over the table; table: what its fit found, None where the camera's
    pose was believed.
    """

    method: Method
    q: np.ndarray
    z_m: float
    pixel: np.ndarray
    T_camera_grasp: np.ndarray
    T_robot_grasp: np.ndarray | None
    score: float
    robust_score: float
    function: RobustFunction
    seen: HeightMap
    camera: Camera
    table: TableFit | None


@dataclass(frozen=True, eq=False)
class NoGrasp:
    """No pose to command, with the reason in a line; table: what its fit found, where it found one."""

    reason: str
    table: TableFit | None = None


@dataclass(frozen=True, eq=False)
class GraspPlanner:
    """Plans on depth images. It holds nothing that changes: the same image gives the same grasp, from any thread.

    input: `network.*.input` of the network behind `predict`. gripper, table, refinement: as gripper, table and plan in
    params.yaml. fewest_px: a side that have to see a cell of the height map, for an image like those of training.
    """

    predict: Predictor
    input: str
    gripper: Gripper
    table: Table
    refinement: Plan
    fewest_px: float = FEWEST_PX

    @classmethod
    def load(
        cls, model: Path, gripper: Gripper | None = None, table: Table | None = None, plan: Plan | None = None
    ) -> GraspPlanner:
        """With the network in a model's folder, and what its config.json says of the rest unless it is given here.

        A folder of data/networks will do where gripper, table and plan are given. WeightsError, ModelError or
        ParameterError, in one line that names the file, where the folder is none.
        """
        from graspfn.learning.prediction import OneByOne  # torch takes a second to load
        from graspfn.learning.weights import input_kind, load_network, read_config

        config = read_config(model)
        if "format" in config or gripper is None or table is None or plan is None:
            check_model(config, model)
        gripper = gripper or build(Gripper, config.get("gripper"), f"{model}/config.json: gripper")
        table = table or build(Table, config.get("table"), f"{model}/config.json: table")
        plan = plan or build(Plan, config.get("plan"), f"{model}/config.json: plan")
        fewest_px = config.get("camera", {}).get("fewest_px", FEWEST_PX)
        return cls(OneByOne(load_network(model)), input_kind(model), gripper, table, plan, fewest_px)

    def plan(
        self,
        depth: np.ndarray,
        camera: Camera,
        uncertainty: PoseUncertainty,
        method: Method | str = Method.ROBUST,
        *,
        posed: bool = True,
        roi: tuple[int, int, int, int] | None = None,
        mask: np.ndarray | None = None,
        T_robot_gripper: np.ndarray | None = None,
        T_gripper_camera: np.ndarray | None = None,
        min_score: float = 0.0,
    ) -> Grasp | NoGrasp:
        """depth: (height, width), metres along the optical axis; NaN, 0 and infinity say that nothing was measured.

        posed: whether the camera's pose is known, as far as `fit_table` needs it. Otherwise the world's origin is where
        the optical axis meets the table, and u the image's x on it.
        roi: (x, y, width, height), px, and mask, (height, width) bool: the pixels that count; beside them the table is
        taken for empty, and it is found in all pixels. min_score: what a pose has to promise.
        Raises DepthError, PlanningError: what was given is no image of this camera, mask, or rigid transform.
        """
        method = Method(method)
        check_image(depth, camera)
        view = _view(depth.shape, roi, mask)
        T_robot_camera = _product(T_robot_gripper, T_gripper_camera)
        try:
            camera, fit = self._stand(depth, camera, posed)
        except TableError as error:
            return NoGrasp(str(error))
        if why := self._too_coarse(camera):
            return NoGrasp(why, fit)
        shown = depth if view is None else np.where(view, depth, camera.bare_table()).astype(np.float32)
        seen = height_map(shown, camera)
        if why := whole_object(seen, shown, camera, view):
            return NoGrasp(why, fit)
        function = RobustFunction(self._function(shown, seen, camera), uncertainty)
        q = self._pose(method, function, seen)
        if q is None:
            return NoGrasp("score: no pose has one above 0", fit)
        score, robust_score = (float(f.at(q[None]).item()) for f in (RobustFunction(function.f, CERTAIN), function))
        if robust_score < min_score:
            return NoGrasp(f"score: {robust_score:.3f} at best; min_score takes {min_score:g}", fit)
        z_m = self.gripper.clearance_mm / 1000
        T_camera_table, here, T_robot_grasp = np.linalg.inv(camera.T_world_camera), np.eye(4), None
        if T_robot_camera is not None:
            T_robot_grasp = T_robot_target(T_robot_camera, here, T_camera_table, q, z_m)
        return Grasp(
            method=method,
            q=q,
            z_m=z_m,
            pixel=_pixel(q, z_m, camera),
            T_camera_grasp=T_robot_target(here, here, T_camera_table, q, z_m),
            T_robot_grasp=T_robot_grasp,
            score=score,
            robust_score=robust_score,
            function=function,
            seen=seen,
            camera=camera,
            table=fit,
        )

    def _stand(self, depth: np.ndarray, camera: Camera, posed: bool) -> tuple[Camera, TableFit | None]:
        """The camera where it stands over the table. Networks that see the depth image itself believe its pose."""
        if self.input == "depth" and not posed:
            raise PlanningError("camera: its pose is unknown; a network with input: depth takes the paper's")
        if self.input == "depth":
            check_papers(camera)
            return camera, None
        if posed and not self.table.fit:
            return camera, None
        if posed:
            fit = fit_table(depth, camera, self.table)
        else:
            limits = dataclasses.replace(self.table, max_offset_mm=np.inf)
            fit = _over_the_axis(fit_table(depth, camera, limits))
        return camera.at(fit.T_world_camera), fit

    def _too_coarse(self, camera: Camera) -> str:
        px = min(camera.K[:2]) * CELL_M / camera.table_depth
        if px >= self.fewest_px:
            return ""
        nearest = camera.table_depth * px / self.fewest_px
        return (
            f"camera: {camera.table_depth:.2f} m from the table {px:.2g} px see {1000 * CELL_M:g} mm, where the "
            f"network takes {self.fewest_px:g}; that is from {nearest:.2f} m and nearer"
        )

    def _function(self, depth: np.ndarray, seen: HeightMap, camera: Camera) -> np.ndarray:
        """(33, 44, 6) float64: the network's scores where the gripper meets the object, 0 elsewhere."""
        if self.input == "depth":
            inputs = depth_input(fill_holes(depth, camera), camera)[None]
        else:
            inputs = height_map_input(seen)
        scores, _ = self.predict(inputs)
        return np.where(meets(object_mask(seen), self.gripper), scores, 0.0)

    def _pose(self, method: Method, function: RobustFunction, seen: HeightMap) -> np.ndarray | None:
        if method is Method.CENTROID:
            return centroid_grasp(seen)
        if method is Method.BEST:
            return best_grasp(function.f)
        highest = function.highest(self.refinement)
        return None if highest is None else function.between(highest.poses[0], self.refinement)


CERTAIN = PoseUncertainty((0.0, 0.0))


def _over_the_axis(fit: TableFit) -> TableFit:
    """The same with the world's origin where the optical axis meets the table, and +u along the image's x on it."""
    T = rotation_z(-np.arctan2(fit.T_world_camera[1, 0], fit.T_world_camera[0, 0])) @ fit.T_world_camera
    ahead = T[:3, 2]
    x, y, _ = T[:3, 3] + ahead * (T[2, 3] / -ahead[2])
    return dataclasses.replace(fit, T_world_camera=translation(-x, -y) @ T)


def _pixel(q: np.ndarray, z_m: float, camera: Camera) -> np.ndarray:
    """(3,) (x, y [px], theta [rad]) of a grasp as the camera sees it; a millimetre either way gives its direction."""
    closing = np.array([[0, 0, z_m], [-0.001, 0, z_m], [0.001, 0, z_m]])
    (x, y), before, after = camera.project(apply(T_world_grasp(q), closing))[:, :2]
    dx, dy = after - before
    return np.array([x, y, np.arctan2(dy, dx) % np.pi])


def _view(shape: tuple[int, ...], roi: tuple[int, int, int, int] | None, mask: np.ndarray | None) -> np.ndarray | None:
    """(height, width) bool: the pixels that count; None for all."""
    if roi is None and mask is None:
        return None
    view = np.ones(shape, dtype=bool)
    if mask is not None:
        if mask.shape != shape:
            raise PlanningError(f"mask: has the shape {mask.shape}; it takes that of the image, {shape}")
        view &= mask.astype(bool)
    if roi is not None:
        x, y, width, height = roi
        if not (0 <= x < x + width <= shape[1] and 0 <= y < y + height <= shape[0]):
            raise PlanningError(f"roi: {roi} is not within the image; it takes (x, y, width, height), px")
        inside = np.zeros(shape, dtype=bool)
        inside[y : y + height, x : x + width] = True
        view &= inside
    if not view.any():
        raise PlanningError("mask: no pixel is left; it takes those that may show the object")
    return view


def _product(T_robot_gripper: np.ndarray | None, T_gripper_camera: np.ndarray | None) -> np.ndarray | None:
    """T_robot_camera (4, 4), None where neither is given; PlanningError where one is missing or is not rigid."""
    given = {"T_robot_gripper": T_robot_gripper, "T_gripper_camera": T_gripper_camera}
    if all(T is None for T in given.values()):
        return None
    product = np.eye(4)
    for name, T in given.items():
        if T is None:
            raise PlanningError(f"{name}: missing; it takes both frames or neither")
        product = product @ check_rigid(T, name)
    return product


def check_rigid(T: np.ndarray, name: str) -> np.ndarray:
    """(4, 4) float64, if T is a rigid transform; PlanningError if it is none."""
    matrix = np.asarray(T, dtype=float)
    rigid = matrix.shape == (4, 4) and np.allclose(matrix[3], [0, 0, 0, 1])
    turn = matrix[:3, :3] if rigid else np.zeros((3, 3))
    if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-4) or np.linalg.det(turn) < 0:
        raise PlanningError(f"{name}: takes a rigid transform, 4 x 4")
    return matrix
