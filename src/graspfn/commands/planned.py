"""What `graspfn plan` does: options to what they stand for, then image by image to a grasp or the reason for none."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import typer
from PIL import Image, UnidentifiedImageError

from graspfn.commands.answers import answer, in_words
from graspfn.commands.camera_files import read_camera, read_covariance_file, read_transform
from graspfn.commands.depth_files import Unit, read_depth
from graspfn.commands.ending import BAD_INPUT, NO_GRASP, InputError
from graspfn.imaging.camera import Camera
from graspfn.imaging.holes import DepthError
from graspfn.params import ParameterError, check_pose
from graspfn.planning.model import DEFAULT
from graspfn.planning.planner import Grasp, GraspPlanner, Method, NoGrasp
from graspfn.planning.uncertainty import PlanningError, PoseUncertainty

Choice = TypeVar("Choice", Unit, Method)
CameraOf = Callable[[str, tuple[int, int], Camera | None], Camera]
MOST_PX = 1e6
Matrix = tuple[str, np.ndarray]  # with how it was given: "--covariance sigma.txt"


@dataclass(frozen=True, eq=False)
class Request:
    """The options, read and checked; `camera` finds that of an image by name, its shape and the camera it came with."""

    model: tuple[Path, GraspPlanner]
    camera: CameraOf
    unit: Unit | None
    topic: str | None
    T_world_camera: np.ndarray | None
    uncertainty: PoseUncertainty
    method: Method
    roi: tuple[int, int, int, int] | None
    mask: np.ndarray | None
    frames: dict[str, np.ndarray]
    min_score: float
    figure: Callable[[Path], Path] | None


def plan_all(images: list[Path], request: Request, as_json: bool) -> int:
    """Answers every image, whatever is wrong with others; the exit status is that of the worst."""
    folder, planner = request.model
    status = 0
    for path in images:
        try:
            depth, found = _plan(path, request)
            told = answer(str(path), found, str(folder))
            if request.figure:
                _draw(request.figure(path), path, depth, found, planner.gripper.opening_mm)
        except InputError as error:
            typer.echo(str(error), err=True)
            told, status = {"image": str(path), "error": str(error)}, BAD_INPUT
        else:
            status = max(status, NO_GRASP if isinstance(found, NoGrasp) else 0, key=[0, NO_GRASP, BAD_INPUT].index)
        if as_json:
            typer.echo(json.dumps(told))
        elif "error" not in told:
            typer.echo(in_words(told))
    return status


def _plan(path: Path, request: Request) -> tuple[np.ndarray, Grasp | NoGrasp]:
    depth, own = read_depth(path, request.unit, request.topic)
    return depth, plan_one(str(path), depth, own, request)


def plan_one(name: str, depth: np.ndarray, own: Camera | None, request: Request) -> Grasp | NoGrasp:
    """depth: (height, width), metres; own: the camera that it came with. InputError names the image, or the option."""
    camera = request.camera(name, depth.shape, own)
    if request.T_world_camera is not None:
        camera = camera.at(request.T_world_camera)
    try:
        return request.model[1].plan(
            depth,
            camera,
            request.uncertainty,
            request.method,
            posed=request.T_world_camera is not None,
            roi=request.roi,
            mask=request.mask,
            min_score=request.min_score,
            **request.frames,
        )
    except (DepthError, PlanningError) as error:
        option = "--" if str(error).startswith(("roi:", "mask:", "camera:")) else ""
        raise InputError(f"{name}: {option}{error}") from None


def _draw(out: Path, path: Path, depth: np.ndarray, found: Grasp | NoGrasp, opening_mm: float) -> None:
    from graspfn.reporting.figures.planned_grasp import draw_planned_grasp  # matplotlib is slow to import
    from graspfn.reporting.figures.style import png_bytes

    try:
        out.write_bytes(png_bytes(draw_planned_grasp(depth, found, opening_mm, path.name)))
    except OSError as error:
        raise InputError(f"--figure {out}: cannot be written: {error.strerror}") from None


def checked_model(given: Path | None) -> tuple[Path, GraspPlanner]:
    """A folder's, or by its name one that comes along; with what answers call it."""
    model = given or Path(DEFAULT.name)
    along = {folder.name: folder for folder in sorted(DEFAULT.parent.iterdir()) if folder.is_dir()}
    folder = model if given and given.exists() else along.get(str(model), model)
    if not folder.exists():
        raise InputError(f"--model {given}: no such folder; it takes a model's, or {' or '.join(along)}")
    try:
        return model, GraspPlanner.load(folder)
    except ValueError as error:  # ModelError, WeightsError, ParameterError
        raise InputError(f"--model {given}: {error}") from None


def camera_of(file: Path | None, numbers: dict[str, float | None], distortion: tuple[float, ...] = ()) -> CameraOf:
    """--camera, or --fx --fy --cx --cy (and the lens that is said), or the camera that the image's file has."""
    given = {name: value for name, value in numbers.items() if value is not None}
    if file is not None and given:
        raise InputError(f"{next(iter(given))}: takes no --camera beside it")
    if given and (missing := [name for name in numbers if name not in given]):
        raise InputError(f"{missing[0]}: missing; it takes all of {' '.join(numbers)}")
    for name, value in given.items():
        if not abs(value) <= MOST_PX or (name in ("--fx", "--fy") and value < 1):
            raise InputError(f"{name} {value:g}: takes pixels, up to {MOST_PX:g}; a focal length has at least 1")

    def of(name: str, shape: tuple[int, int], own: Camera | None) -> Camera:
        if file is not None:
            return read_camera(file, shape)
        if given:
            fx, fy, cx, cy = given.values()
            return Camera(shape[1], shape[0], (fx, fy, cx, cy), distortion)
        if own is None:
            raise InputError(f"{name}: --camera: missing, and the file says of none; or --fx --fy --cx --cy")
        return own

    return of


def unit_of(text: str | None) -> Unit | None:
    return None if text is None else _choice("--depth-unit", text, Unit)


def method_of(text: str) -> Method:
    return _choice("--method", text, Method)


def _choice(option: str, text: str, kind: type[Choice]) -> Choice:
    try:
        return kind(text)
    except ValueError:
        raise InputError(f"{option} {text}: takes one of {', '.join(kind)}") from None


def transform_in(file: Path | None, option: str) -> Matrix | None:
    return None if file is None else (f"{option} {file}", read_transform(file, option))


def covariance_in(file: Path | None) -> Matrix | None:
    option = "--covariance"
    return None if file is None else (f"{option} {file}", read_covariance_file(file, option))


def pose_of(given: Matrix | None) -> np.ndarray | None:
    if given is None:
        return None
    name, T = given
    try:
        check_pose(tuple(T.ravel().tolist()), name)
    except ParameterError as error:
        raise InputError(str(error)) from None
    return T


def uncertainty_of(
    uv_mm: float | None, theta_deg: float | None, covariance: Matrix | None, needed: bool
) -> PoseUncertainty:
    given = {"--sigma-uv-mm": uv_mm, "--sigma-theta-deg": theta_deg}
    if covariance is not None:
        name, matrix = covariance
        if any(value is not None for value in given.values()):
            raise InputError(f"{name}: takes no --sigma-uv-mm and --sigma-theta-deg beside it")
        try:
            return PoseUncertainty(matrix)
        except PlanningError as error:
            raise InputError(f"{name}: {error}") from None
    if not needed and uv_mm is None and theta_deg is None:
        return PoseUncertainty((0.0, 0.0))
    for name, value in given.items():
        if value is None:
            raise InputError(f"{name}: missing; it takes the gripper's errors (docs/planning.md), or --covariance")
        if not 0 <= value < math.inf:
            raise InputError(f"{name} {value:g}: takes a finite number of at least 0")
    assert uv_mm is not None and theta_deg is not None
    try:
        return PoseUncertainty.of(uv_mm, theta_deg)
    except PlanningError as error:  # beyond what can be reckoned with
        raise InputError(f"--sigma-uv-mm, --sigma-theta-deg: {error}") from None


def roi_of(text: str | None) -> tuple[int, int, int, int] | None:
    if text is None:
        return None
    try:
        x, y, width, height = (int(word) for word in text.split(","))
    except ValueError:
        raise InputError(f"--roi {text}: takes four whole numbers X,Y,W,H, px") from None
    return x, y, width, height


def mask_of(file: Path | None) -> np.ndarray | None:
    """(height, width) bool."""
    if file is None:
        return None
    try:
        with Image.open(file) as image:
            mask = np.asarray(image)
    except UnidentifiedImageError:
        raise InputError(f"--mask {file}: takes an image") from None
    except OSError as error:
        raise InputError(f"--mask {file}: cannot be read: {error.strerror or error}") from None
    if mask.ndim != 2:
        raise InputError(f"--mask {file}: has the shape {mask.shape}; it takes one channel")
    return mask != 0


def frames_of(robot_from_gripper: Matrix | None, gripper_from_camera: Matrix | None) -> dict[str, np.ndarray]:
    if robot_from_gripper is None and gripper_from_camera is None:
        return {}
    if robot_from_gripper is None or gripper_from_camera is None:
        missing = "--robot-from-gripper" if robot_from_gripper is None else "--gripper-from-camera"
        raise InputError(f"{missing}: missing; it takes both frames or neither")
    return {"T_robot_gripper": robot_from_gripper[1], "T_gripper_camera": gripper_from_camera[1]}


def share(option: str, value: float) -> float:
    if not 0 <= value <= 1:
        raise InputError(f"{option} {value:g}: takes a number from 0 to 1")
    return value


def figure_of(out: Path | None, images: list[Path]) -> Callable[[Path], Path] | None:
    if out is None:
        return None
    if out.suffix.lower() != ".png":
        raise InputError(f"--figure {out}: takes a name that ends in .png")
    if not out.parent.is_dir():
        raise InputError(f"--figure {out}: no folder {out.parent}")
    return lambda path: out if len(images) == 1 else out.with_stem(f"{out.stem}-{path.stem}")
