"""What an HTTP request may say beside its image: the options of `graspfn plan`, with their names and meanings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from graspfn.commands import planned
from graspfn.commands.camera_files import matrix_of
from graspfn.commands.depth_files import Unit
from graspfn.commands.ending import InputError
from graspfn.planning.planner import GraspPlanner, Method, check_rigid
from graspfn.planning.uncertainty import PlanningError

LENS = "Of the lens, as OpenCV orders it: k1,k2,p1,p2[,k3[,k4,k5,k6]]. None: rectified images, as most drivers have."
FRAME = "4 x 4 numbers, row by row, metres."


class Query(BaseModel):
    """Numbers of a list stand between commas or blanks."""

    model_config = ConfigDict(extra="forbid")

    fx: Annotated[float, Field(description="Focal lengths and principal point of the camera, px.")]
    fy: float
    cx: float
    cy: float
    distortion: Annotated[str | None, Field(description=LENS)] = None
    camera_pose: Annotated[
        str | None,
        Field(description=f"T_world_camera, {FRAME} None: the table's origin is where the optical axis meets it."),
    ] = None
    depth_unit: Annotated[
        Unit | None, Field(description="None: mm for whole numbers, else m. A unit without a table is refused.")
    ] = None
    sigma_uv_mm: Annotated[float | None, Field(description="Std of where the gripper arrives.")] = None
    sigma_theta_deg: Annotated[float | None, Field(description="Std of its angle.")] = None
    covariance: Annotated[
        str | None, Field(description="Of (u, v, theta) instead, 3 x 3 numbers, metres and radians.")
    ] = None
    method: Method = Method.ROBUST
    roi: Annotated[str | None, Field(description="X,Y,W,H: only these pixels may show the object.")] = None
    robot_from_gripper: Annotated[
        str | None, Field(description=f"The gripper in the robot's frame when it saw the image: {FRAME}")
    ] = None
    gripper_from_camera: Annotated[
        str | None, Field(description=f"The camera in the gripper's frame, by hand-eye calibration: {FRAME}")
    ] = None
    min_score: Annotated[float, Field(description="No grasp if it promises less, 0 to 1.")] = 0.0

    def request(self, model: tuple[Path, GraspPlanner]) -> planned.Request:
        """InputError names the option as the command line has it."""
        numbers: dict[str, float | None] = {f"--{name}": getattr(self, name) for name in ("fx", "fy", "cx", "cy")}
        covariance, pose = _matrix("--covariance", self.covariance, 3), _transform("--camera-pose", self.camera_pose)
        return planned.Request(
            model=model,
            camera=planned.camera_of(None, numbers, _numbers("--distortion", self.distortion)),
            unit=self.depth_unit,
            topic=None,
            T_world_camera=planned.pose_of(pose),
            uncertainty=planned.uncertainty_of(
                self.sigma_uv_mm, self.sigma_theta_deg, covariance, needed=self.method is Method.ROBUST
            ),
            method=self.method,
            roi=planned.roi_of(self.roi),
            mask=None,
            frames=planned.frames_of(
                _transform("--robot-from-gripper", self.robot_from_gripper),
                _transform("--gripper-from-camera", self.gripper_from_camera),
            ),
            min_score=planned.share("--min-score", self.min_score),
            figure=None,
        )


def _matrix(option: str, text: str | None, size: int) -> planned.Matrix | None:
    return None if text is None else (option, matrix_of(text, option, size))


def _transform(option: str, text: str | None) -> planned.Matrix | None:
    if text is None:
        return None
    try:
        return option, check_rigid(matrix_of(text, option, 4), option)
    except PlanningError as error:
        raise InputError(str(error)) from None


def _numbers(option: str, text: str | None) -> tuple[float, ...]:
    try:
        numbers = tuple(float(word) for word in (text or "").replace(",", " ").split())
    except ValueError as error:
        raise InputError(f"{option}: {error}") from None
    if len(numbers) not in (0, 4, 5, 8) or not np.isfinite(numbers).all():
        raise InputError(f"{option}: has {len(numbers)} numbers; it takes 4, 5 or 8 finite ones")
    return numbers
