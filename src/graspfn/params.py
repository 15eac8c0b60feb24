"""Every parameter of the workflow: its type, unit, meaning and limits, and the loader that checks params.yaml.

Values only: no stage depends on this file (DVC tracks the values themselves), so nothing computed lives here.
"""

from __future__ import annotations

import dataclasses
import math
import os
import re
import types
import typing
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypeVar

import yaml

T = TypeVar("T")
SOURCES = ("procedural", "open_objects", "rgb_objects", "random_urdfs", "ycb", "modelnet40", "folder")
FOLDERS = ("meshes.folder", "robot.folder")  # of the user's own files
LOOK_MS = 10  # attempts look at their state this often, and so take steps of which so much is a multiple


class ParameterError(ValueError):
    """A parameter that cannot be: one line that names the key and says what it takes."""


@dataclass(frozen=True)
class Key:
    """What a parameter means and what it may be."""

    meaning: str
    at_least: float | None = None
    above: float | None = None
    at_most: float | None = None
    one_of: tuple[str, ...] = ()

    def check(self, value: Any, key: str) -> None:
        for item in value if isinstance(value, tuple) else (value,):
            if item is None:
                continue
            if self.one_of and item not in self.one_of:
                raise ParameterError(f"{key}: {item!r} is not one of {', '.join(self.one_of)}")
            if isinstance(item, str):
                self._check_text(item, key)
            if self.at_least is not None and not item >= self.at_least:
                raise ParameterError(f"{key}: {item} is below {self.at_least:g}; it takes {self.meaning}")
            if self.above is not None and not item > self.above:
                raise ParameterError(f"{key}: {item} is not above {self.above:g}; it takes {self.meaning}")
            if self.at_most is not None and not item <= self.at_most:
                raise ParameterError(f"{key}: {item} is above {self.at_most:g}; it takes {self.meaning}")

    def _check_text(self, text: str, key: str) -> None:
        if not text:
            raise ParameterError(f"{key}: empty; it takes {self.meaning}")
        if "${" in text:
            raise ParameterError(f"{key}: {text!r} holds ${{, which begins a template of DVC; it takes {self.meaning}")
        if any("\ud800" <= character <= "\udfff" for character in text):  # how Python hands on bytes that are not UTF-8
            raise ParameterError(f"{key}: {text!r} is not UTF-8; it takes {self.meaning}")


@dataclass(frozen=True)
class Meshes:
    """Where objects come from (paper IV-C, 'Objects were selected ...') and how many (VII)."""

    source: Annotated[str, Key("source", one_of=SOURCES)]
    folder: Annotated[str, Key("directory or .zip of mesh files, for sources folder and modelnet40")]
    split: Annotated[str, Key("what training and test objects never share", one_of=("shape", "family"))]
    train: Annotated[int, Key("objects to train on", at_least=1)]
    test: Annotated[int, Key("other objects to test on", at_least=1)]
    size_min_cm: Annotated[float, Key("smallest largest-dimension of an object, cm", above=0)]
    size_max_cm: Annotated[float, Key("largest largest-dimension of an object, cm", above=0)]
    collision_faces: Annotated[
        int, Key("faces of a collision mesh; the rendered mesh keeps all of its own", at_least=20)
    ]
    collision_tolerance_mm: Annotated[
        float, Key("most a collision mesh departs from the mesh; else it keeps more faces", above=0)
    ]


@dataclass(frozen=True)
class Camera:
    """A depth camera and where it stands. The paper's looks straight down, 14 px spanning 10 mm (III)."""

    width_px: Annotated[int, Key("image width, px", at_least=16)]
    height_px: Annotated[int, Key("image height, px", at_least=16)]
    fx_px: Annotated[float, Key("focal length along the image's rows, px", above=0)]
    fy_px: Annotated[float, Key("focal length along its columns, px", above=0)]
    cx_px: Annotated[float, Key("principal point, px from the centre of the leftmost pixel")]
    cy_px: Annotated[float, Key("principal point, px from the centre of the uppermost pixel")]
    distortion: Annotated[
        tuple[float, ...] | None, Key("of the lens, as OpenCV orders it: k1 k2 p1 p2 [k3 [k4 k5 k6]]; null: none")
    ]
    height_mm: Annotated[float, Key("lens above the middle of Q, mm, looking straight down", above=0)]
    pose: Annotated[
        tuple[float, ...] | None,
        Key("T_world_camera instead, 4 x 4 numbers row by row, m; null: as height_mm says"),
    ]
    renderer: Annotated[str, Key("depth renderer", one_of=("embree", "opengl"))]


@dataclass(frozen=True)
class Table:
    """The table's plane, found in every depth image that becomes a height map."""

    fit: Annotated[bool, Key("find the plane in the image; false: believe the camera's height and pose")]
    max_tilt_deg: Annotated[float, Key("refuse a camera further from straight down, degrees", above=0, at_most=90)]
    min_inliers: Annotated[float, Key("refuse where less of what is measured is table, share", above=0, at_most=1)]
    max_rms_mm: Annotated[float, Key("refuse a table rougher or an image noisier than this, mm rms", above=0)]
    max_offset_mm: Annotated[float, Key("refuse a table further from where the camera's pose has it, mm", above=0)]


@dataclass(frozen=True)
class Noise:
    """Depth noise of the paper's eq. 2 (IV-B), then what else networks with input: height_map are trained against."""

    sigma_p_px: Annotated[float, Key("std of pixel localisation, px", at_least=0)]
    sigma_d_mm: Annotated[float, Key("std of the depth measurement, mm", at_least=0)]
    # Of what follows each training sample draws its own amount; docs/training.md has their sources.
    camera_tilt_deg: Annotated[
        float, Key("most tilt of the camera, which looks at the middle of Q", at_least=0, at_most=45)
    ] = 0.0
    camera_height_mm: Annotated[
        float, Key("most change of the camera's distance, mm, either way", at_least=0, at_most=200)
    ] = 0.0
    baseline_mm: Annotated[
        float, Key("most distance of the projector or second camera, behind whose shadows no depth is, mm", at_least=0)
    ] = 0.0
    table_offset_mm: Annotated[float, Key("std of the table's height left over after its fit, mm", at_least=0)] = 0.0
    table_tilt_deg: Annotated[float, Key("std of the table's slope left over after its fit, degrees", at_least=0)] = 0.0
    wave_mm: Annotated[float, Key("most rms of slow errors of depth, of wavelengths 3 to 20 cm, mm", at_least=0)] = 0.0
    scale: Annotated[float, Key("most relative error of heights, either way", at_least=0, at_most=0.5)] = 0.0
    step_mm: Annotated[float, Key("most step between the depths that the camera tells apart, mm", at_least=0)] = 0.0
    holes: Annotated[float, Key("most share of cells without depth, in blobs and speckle", at_least=0, at_most=0.9)] = (
        0.0
    )
    edges: Annotated[
        float,
        Key("most share of cells at depth edges that lie between both sides or are unseen", at_least=0, at_most=1),
    ] = 0.0
    specks: Annotated[float, Key("most share of cells with a height of chance, up to 10 cm", at_least=0, at_most=1)] = (
        0.0
    )
    clutter: Annotated[float, Key("share of samples with something else at the border", at_least=0, at_most=1)] = 0.0


@dataclass(frozen=True)
class Gripper:
    """A hand moved kinematically and two fingers, each with a drive of its own; which joints they have is its kind."""

    name: Annotated[str, Key("name of the gripper, for reports")]
    joints: Annotated[str, Key("joints of the fingers", one_of=("revolute", "prismatic"))]
    opening_mm: Annotated[float, Key("distance between the open fingertips, mm", above=0)]
    finger_length_mm: Annotated[float, Key("underside of the palm to fingertip, mm", above=0)]
    finger_width_mm: Annotated[float, Key("finger size across the closing direction, mm", above=0)]
    finger_thickness_mm: Annotated[float, Key("finger size along the closing direction, mm", above=0)]
    palm_length_mm: Annotated[float, Key("palm size along the closing direction, mm", above=0)]
    palm_width_mm: Annotated[float, Key("palm size across the closing direction, mm", above=0)]
    palm_height_mm: Annotated[float, Key("palm size above its underside, mm", above=0)]
    clearance_mm: Annotated[float, Key("fingertips above the table at their lowest, mm", above=0)]


@dataclass(frozen=True)
class RevoluteGripper(Gripper):
    """A hand moved kinematically, two fingers on revolute joints under constant torque (paper IV-A)."""

    knuckle_mm: Annotated[float, Key("distance between the two finger joints, mm", above=0)]
    finger_inertia_kgm2: Annotated[float, Key("moment of inertia of a finger about its joint, kg m^2", above=0)]
    torque_nm: Annotated[float, Key("constant closing torque on each finger, N m", above=0)]
    gear_friction_nm: Annotated[float, Key("Coulomb friction of each finger's drive, N m", at_least=0)]
    closing_speed_rads: Annotated[float, Key("most speed of a closing finger, rad/s", above=0)]


@dataclass(frozen=True)
class PrismaticGripper(Gripper):
    """A hand moved kinematically, two fingers on prismatic joints under constant force: a parallel jaw."""

    finger_mass_kg: Annotated[float, Key("mass of a finger, kg", above=0)]
    force_n: Annotated[float, Key("constant closing force on each finger, N", above=0)]
    drive_friction_n: Annotated[float, Key("Coulomb friction of each finger's drive, N", at_least=0)]
    closing_speed_mms: Annotated[float, Key("most speed of a closing finger, mm/s", above=0)]


@dataclass(frozen=True)
class Physics:
    """The simulated world (docs/physics.md says how the values were chosen)."""

    time_step_ms: Annotated[float, Key("integration step, ms", above=0, at_most=5)]
    detector: Annotated[str, Key("DART collision detector", one_of=("ode", "fcl", "bullet", "dart"))]
    friction: Annotated[float, Key("Coulomb coefficient of every contact", above=0)]
    density_kgm3: Annotated[float, Key("object density, kg/m^3", above=0)]
    reference: Annotated[bool, Key("labels without culling or early stops, forty times slower: to check them")]


@dataclass(frozen=True)
class Settle:
    """Dropping an object in a random orientation until it rests, at a size that fits the gripper (paper IV-C)."""

    drop_mm: Annotated[float, Key("height of the lowest point at the drop, mm", at_least=0)]
    limit_s: Annotated[float, Key("simulated time after which an object counts as never resting, s", above=0)]
    fit: Annotated[
        bool, Key("objects of which no part fits the gripper are made smaller or dropped anew; false: all are kept")
    ]
    room_mm: Annotated[
        float, Key("room that a part of an object has to leave between the open fingers, mm", at_least=0)
    ]


@dataclass(frozen=True)
class Attempt:
    """One grasp: close for a fixed time, rise at constant speed (paper IV-A)."""

    close_s: Annotated[float, Key("time for the fingers to close before the hand rises, s", above=0)]
    lift_mm: Annotated[float, Key("rise of the hand, mm", above=0)]
    lift_speed_mms: Annotated[float, Key("speed of the rise, mm/s", above=0)]


@dataclass(frozen=True)
class Label:
    """Labelling of every pose of Q (paper IV-C)."""

    attempts: Annotated[int, Key("attempts per pose, drawn uniformly inside its cell", at_least=1, at_most=255)]
    test: Annotated[
        int, Key("test objects to label as well, the first: their true function is Table 1's ceiling", at_least=1)
    ]
    max_failed: Annotated[float, Key("fraction of objects that may fail before the stage does", at_least=0, at_most=1)]


@dataclass(frozen=True)
class Augment:
    """Random shifts, rotations and reflections of each training image (paper VII)."""

    samples: Annotated[int, Key("augmented samples per training image", at_least=1)]
    mirror: Annotated[bool, Key("every other sample is seen in a mirror, in which the gripper is the same")]
    empty: Annotated[float, Key("share of samples without the object: every grasp fails", at_least=0, at_most=0.9)]


@dataclass(frozen=True)
class Network:
    """One architecture and how it is optimised."""

    architecture: Annotated[str, Key("network architecture", one_of=("alexnet", "fcn", "turned"))]
    width: Annotated[int, Key("channels of the first convolution; deeper ones scale with it", at_least=1)]
    learning_rate: Annotated[float, Key("peak learning rate of AdamW", above=0)]
    weight_decay: Annotated[float, Key("weight decay of AdamW", at_least=0)]
    input: Annotated[str, Key("what it sees", one_of=("depth", "height_map"))] = field(default="depth", kw_only=True)

    @property
    def channels(self) -> int:
        """Of the input (B, channels, 132, 176): heights, and of a height map also where there are any."""
        return 2 if self.input == "height_map" else 1


@dataclass(frozen=True)
class AlexNet(Network):
    """The paper's architecture, which alone has fully-connected layers."""

    hidden: Annotated[int, Key("units of the first fully-connected layer", at_least=1)]
    dropout: Annotated[float, Key("dropout before each fully-connected layer", at_least=0, at_most=0.95)]


@dataclass(frozen=True)
class Pretrain:
    """Object classification before the grasp function (paper VII)."""

    epochs: Annotated[float, Key("passes over the augmented training set; 0 leaves it out", at_least=0)]
    batch_size: Annotated[int, Key("samples per gradient step", at_least=1)]


@dataclass(frozen=True)
class Train:
    """Learning the grasp function (paper V)."""

    epochs: Annotated[float, Key("passes over the augmented training set", above=0)]
    batch_size: Annotated[int, Key("samples per gradient step", at_least=1)]


@dataclass(frozen=True)
class Plan:
    """Refinement of the commanded pose below the spacing of Q (paper VI, 'trilinear interpolation')."""

    fine_uv: Annotated[int, Key("refined positions per 10 mm cell", at_least=1)]
    fine_theta: Annotated[int, Key("refined angles per 30 degree cell", at_least=1)]


@dataclass(frozen=True)
class Evaluate:
    """The uncertainties of Table 1 (paper VII-A), and how often each test object meets them."""

    sigma_uv_mm: Annotated[tuple[float, ...], Key("std of the reached position, mm", at_least=0)]
    sigma_theta_deg: Annotated[tuple[float, ...], Key("std of the reached angle, degrees", at_least=0)]
    errors_per_object: Annotated[int, Key("errors drawn for each object: trials of a method in a cell", at_least=1)]
    max_failed: Annotated[float, Key("fraction of objects that may fail before the stage does", at_least=0, at_most=1)]


@dataclass(frozen=True)
class Disturb:
    """Disturbed depth images of the test objects, planned on with and without the fit of the table: robustness."""

    objects: Annotated[int, Key("test objects seen disturbed, labelled ones if there are", at_least=1)]
    errors_per_object: Annotated[int, Key("errors drawn for each of them: trials of a plan", at_least=1)]
    sigma_uv_mm: Annotated[float, Key("std of the reached position, mm", above=0)]
    sigma_theta_deg: Annotated[float, Key("std of the reached angle, degrees", above=0)]
    offset_mm: Annotated[tuple[float, ...], Key("camera higher than it is believed to be, mm", at_least=-100)]
    tilt_deg: Annotated[tuple[float, ...], Key("camera looks elsewhere than is believed, degrees", at_most=60)]
    wave_mm: Annotated[tuple[float, ...], Key("slow errors of depth, of wavelengths 3 to 20 cm, mm rms", at_least=0)]
    scale_percent: Annotated[tuple[float, ...], Key("depths too large, %", above=-50, at_most=50)]
    holes_percent: Annotated[
        tuple[float, ...], Key("pixels without depth, in blobs and speckle, %", at_least=0, at_most=95)
    ]
    step_mm: Annotated[tuple[float, ...], Key("step between the depths that are told apart, mm", at_least=0)]
    height_mm: Annotated[tuple[float, ...], Key("camera higher, as is known, mm", at_least=-200)]
    cameras: Annotated[tuple[str, ...], Key("files of conf/camera: other cameras, with their noise")]
    max_failed: Annotated[float, Key("fraction of scenes that may fail before the stage does", at_least=0, at_most=1)]


@dataclass(frozen=True)
class Robot:
    """The trials of Table 2 (paper VII-B), run by the simulated robot or read from a folder of recordings."""

    source: Annotated[str, Key("who recorded the trials", one_of=("simulated", "folder"))]
    folder: Annotated[str, Key("directory of bags, one for each trial, for source: folder")]
    objects: Annotated[int, Key("test objects the simulated robot grasps", at_least=1)]
    placements: Annotated[int, Key("placements of each object", at_least=1)]
    max_failed: Annotated[
        float, Key("fraction of scenes or bags that may fail before the stage does", at_least=0, at_most=1)
    ]
    sigma_uv_mm: Annotated[tuple[float, ...], Key("std of the reached position in each condition, mm", at_least=0)]
    sigma_theta_deg: Annotated[tuple[float, ...], Key("std of the reached angle in each condition, deg", at_least=0)]
    depth_encoding: Annotated[str, Key("encoding of recorded depth images", one_of=("16UC1", "32FC1"))]


@dataclass(frozen=True)
class Topics:
    """Topic names in the recordings."""

    depth: Annotated[str, Key("sensor_msgs/Image or CompressedImage, the depth image planned on")]
    camera_info: Annotated[str, Key("sensor_msgs/CameraInfo of that image")]
    commanded: Annotated[str, Key("geometry_msgs/PoseStamped sent to the arm")]
    achieved: Annotated[str, Key("geometry_msgs/PoseStamped the gripper reached")]
    joints: Annotated[str, Key("sensor_msgs/JointState of the hand and fingers")]
    outcome: Annotated[str, Key("std_msgs/Bool, held at the top; the last one counts")]
    tf: Annotated[str, Key("tf2_msgs/TFMessage, frames that move")]
    tf_static: Annotated[str, Key("tf2_msgs/TFMessage, frames that do not")]
    gripper: Annotated[str | None, Key("its first message after the command closes the fingers; null: none")]


@dataclass(frozen=True)
class Arm:
    """How recordings tell where the gripper really was as its fingers began to close (paper VII-B)."""

    achieved: Annotated[
        str,
        Key("from topics.achieved, from TF, or from columns reached_...", one_of=("topic", "tf", "columns")),
    ]
    table_frame: Annotated[
        str | None,
        Key("on the table below the image centre; null: where the image and TF show it"),
    ]
    table_z: Annotated[
        str,
        Key(
            "of that frame; down: y is the image's +v, angles turn the other way",
            one_of=("up", "down"),
        ),
    ]
    base_frame: Annotated[str, Key("that never moves")]
    gripper_frame: Annotated[str, Key("between the fingertips")]
    closing_axis: Annotated[
        str, Key("of gripper_frame and of recorded poses, along which the jaws close", one_of=("x", "y", "z"))
    ]
    finger_joints: Annotated[tuple[str, ...] | None, Key("that close the fingers; null: none is recorded")]
    finger_sign: Annotated[int, Key("1 where these grow as the fingers close, else -1", at_least=-1, at_most=1)]
    finger_shut: Annotated[float | None, Key("their mean where the fingers meet, m or rad; null: not checked")]


@dataclass(frozen=True)
class Compute:
    """How the work is done, never what comes out: no stage declares these keys."""

    address: Annotated[str | None, Key("running Dask scheduler, e.g. tcp://host:8786; null: this machine")]
    workers: Annotated[int, Key("worker processes on this machine; 0: one per core that it may use", at_least=0)]
    device: Annotated[str, Key("torch device", one_of=("auto", "cpu", "cuda", "mps"))]
    checkpoint_s: Annotated[float, Key("seconds of training between checkpoints", above=0)]
    loaders: Annotated[int, Key("processes that prepare training samples; 0: none beside the trainer", at_least=0)]


@dataclass(frozen=True)
class Params:
    """params.yaml, whole."""

    seed: Annotated[int, Key("seed of every random draw", at_least=0)]
    scale: Annotated[str, Key("name of the scale and of its folder in reports")]
    meshes: Meshes
    camera: Camera
    table: Table
    noise: Noise
    gripper: Gripper
    physics: Physics
    settle: Settle
    attempt: Attempt
    label: Label
    augment: Augment
    networks: Annotated[tuple[str, ...], Key("networks to train and compare; each is a key of `network`")]
    training_seeds: Annotated[
        tuple[int, ...], Key("added to the seed: each network is trained anew with every one", at_least=0)
    ]
    network: dict[str, Network]
    pretrain: Pretrain
    train: Train
    plan: Plan
    evaluate: Evaluate
    disturb: Disturb
    robot: Robot
    topics: Topics
    arm: Arm
    compute: Compute


def _typed(hint: Any, value: Any, key: str) -> Any:
    """`value` checked against the type hint of `key`, nested dataclasses built."""
    if typing.get_origin(hint) is Annotated:
        hint, rule = typing.get_args(hint)[:2]
        value = _typed(hint, value, key)
        rule.check(value, key)
        return value
    if dataclasses.is_dataclass(hint):
        return build(typing.cast(type, hint), value, key)
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin is dict:
        if not isinstance(value, dict) or not value:
            raise ParameterError(f"{key}: takes one or more named entries, not {value!r}")
        return {name: _typed(args[1], item, f"{key}.{name}") for name, item in value.items()}
    if origin is tuple:
        if not isinstance(value, list | tuple) or not value:
            raise ParameterError(f"{key}: takes a list of {args[0].__name__}, not {value!r}")
        return tuple(_typed(args[0], item, key) for item in value)
    if origin is types.UnionType:
        return None if value is None else _typed(args[0], value, key)
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if hint is float and isinstance(value, str) and re.fullmatch(r"[+-]?\d+[eE][+-]?\d+", value):
        value = float(value)  # YAML 1.1 reads 1e-3 as text
    if isinstance(value, float) and not math.isfinite(value):
        raise ParameterError(f"{key}: takes float, not {value}")
    if not isinstance(value, hint) or (isinstance(value, bool) and hint is not bool) or value != value:
        raise ParameterError(f"{key}: takes {hint.__name__}, not {value!r}")
    return value


def section_type(cls: type, values: dict[str, Any]) -> type:
    """The dataclass that a section's values fill: architecture decides for a network, joints for a gripper."""
    # Where that key is missing or misspelt, the values are checked as what the other keys make of them.
    if cls is Network:
        architecture = values.get("architecture")
        return AlexNet if architecture == "alexnet" or (architecture != "fcn" and "hidden" in values) else Network
    if cls is Gripper:
        joints = values.get("joints")
        prismatic = joints == "prismatic" or (joints != "revolute" and "force_n" in values)
        return PrismaticGripper if prismatic else RevoluteGripper
    return cls


def build(cls: type[T], values: Any, key: str = "") -> T:
    """A parameter dataclass from a mapping of plain values.

    Raises ParameterError for an unknown or missing key, a wrong type or an impossible value.
    """
    prefix = f"{key}." if key else ""
    if not isinstance(values, dict):
        raise ParameterError(f"{key or 'params.yaml'}: takes a mapping, not {values!r}")
    cls = section_type(cls, values)
    hints = typing.get_type_hints(cls, include_extras=True)
    for name in values:
        if name not in hints:
            raise ParameterError(f"{prefix}{name}: unknown key; {key or 'params.yaml'} takes {', '.join(hints)}")
    for name in hints:
        if name not in values:
            raise ParameterError(f"{prefix}{name}: missing")
    return cls(**{name: _typed(hint, values[name], f"{prefix}{name}") for name, hint in hints.items()})


def validate(values: Any) -> Params:
    """The whole of params.yaml, checked key by key and then for keys that must agree."""
    params = build(Params, values)
    if not re.fullmatch(r"[\w.-]*\w", params.scale):
        raise ParameterError(f"scale: {params.scale!r} names a folder of reports; it takes letters, digits, -, _ and .")
    for name in params.networks:
        if name not in params.network:
            raise ParameterError(f"networks: {name!r} is not a key of `network` ({', '.join(params.network)})")
        if params.network[name].input == "depth" and not _is_papers(params.camera):
            raise ParameterError(
                f"network.{name}.input: depth takes the paper's camera, straight down from where 14 px span 10 mm; "
                f"take height_map, which takes any, or leave {name} out of networks"
            )
    if params.meshes.size_max_cm < params.meshes.size_min_cm:
        raise ParameterError("meshes.size_max_cm: below meshes.size_min_cm")
    for key, folder in _folders(params):
        if folder.startswith("~"):
            raise ParameterError(f"{key}: {folder!r} is not expanded; it takes the path in full, or ./{folder}")
        if "://" in folder:
            raise ParameterError(f"{key}: {folder!r} is a URL; it takes a path on this machine")
    _check_fingers(params.gripper, params)
    _check_camera(params.camera, "camera")
    looks = LOOK_MS / params.physics.time_step_ms
    if abs(looks - round(looks)) > 1e-9:
        raise ParameterError(f"physics.time_step_ms: takes a step that goes into {LOOK_MS} ms without rest")
    if len(set(params.training_seeds)) < len(params.training_seeds):
        raise ParameterError("training_seeds: takes each value once")
    for name in ("sigma_uv_mm", "sigma_theta_deg"):
        if len(set(getattr(params.evaluate, name))) < len(getattr(params.evaluate, name)):
            raise ParameterError(f"evaluate.{name}: takes each value once")
    if len(params.robot.sigma_uv_mm) != len(params.robot.sigma_theta_deg):
        raise ParameterError("robot.sigma_theta_deg: takes as many values as robot.sigma_uv_mm")
    if params.arm.finger_sign == 0:
        raise ParameterError("arm.finger_sign: takes 1 or -1")
    if params.arm.achieved == "tf" and not (params.arm.finger_joints or params.topics.gripper):
        raise ParameterError(
            "arm.achieved: tf takes arm.finger_joints or topics.gripper, to know when the fingers close"
        )
    return params


def read_camera(path: Path, noise: Noise) -> tuple[Camera, Noise]:
    """A camera of conf/camera with the noise that it brings, over that of the parameters."""
    values = read_yaml(path)
    if not isinstance(values, dict) or "camera" not in values:
        raise ParameterError(f"{path}: takes a mapping with the key camera")
    camera = build(Camera, values["camera"], f"{path}: camera")
    _check_camera(camera, f"{path}: camera")
    return camera, build(Noise, dataclasses.asdict(noise) | values.get("noise", {}), f"{path}: noise")


def _is_papers(camera: Camera) -> bool:
    """Whether 14 px span 10 mm of the table straight below the image's centre."""
    centred = camera.cx_px == (camera.width_px - 1) / 2 and camera.cy_px == (camera.height_px - 1) / 2
    spans = all(math.isclose(focal * 10 / camera.height_mm, 14, rel_tol=1e-3) for focal in (camera.fx_px, camera.fy_px))
    return centred and spans and not any(camera.distortion or ()) and camera.pose is None


def _check_camera(camera: Camera, key: str) -> None:
    if len(camera.distortion or (0,) * 4) not in (4, 5, 8):
        raise ParameterError(f"{key}.distortion: takes 4, 5 or 8 numbers: k1, k2, p1, p2, then k3, then k4, k5, k6")
    if camera.pose is not None:
        check_pose(camera.pose, f"{key}.pose")


def check_pose(pose: tuple[float, ...], key: str) -> None:
    """The pose of a camera must be a pose, and the camera over the table."""
    if len(pose) != 16:
        raise ParameterError(f"{key}: has {len(pose)} numbers; it takes the 16 of T_world_camera, row by row")
    x, y, z, lens = (pose[i:12:4] for i in range(4))
    cross = [x[i - 2] * y[i - 1] - x[i - 1] * y[i - 2] for i in range(3)]
    lengths = (math.hypot(*axis) for axis in (x, y, z))
    if math.dist(cross, z) > 1e-4 or math.dist(tuple(lengths), (1, 1, 1)) > 1e-4 or pose[12:] != (0, 0, 0, 1):
        raise ParameterError(f"{key}: no rotation and translation; it takes T_world_camera, row by row")
    if lens[2] <= 0 or z[2] >= 0:
        raise ParameterError(f"{key}: takes a camera that looks down (z axis) from over the table (z above 0)")


def _check_fingers(gripper: Gripper, params: Params) -> None:
    """Fingers must move, and meet before the hand rises."""
    if isinstance(gripper, PrismaticGripper):
        effort, friction, tip_mms = "force_n", "drive_friction_n", gripper.closing_speed_mms
    elif isinstance(gripper, RevoluteGripper):
        effort, friction = "torque_nm", "gear_friction_nm"
        tip_mms = gripper.closing_speed_rads * gripper.finger_length_mm
    if getattr(gripper, effort) <= getattr(gripper, friction):
        raise ParameterError(f"gripper.{friction}: takes less than gripper.{effort}, else no finger moves")
    meet_s = gripper.opening_mm / 2 / tip_mms
    if params.attempt.close_s < meet_s:
        raise ParameterError(f"attempt.close_s: takes at least {meet_s:.2g}, in which the open fingertips meet")


def _folders(params: Params) -> Iterator[tuple[str, str]]:
    for key in FOLDERS:
        section, _, name = key.partition(".")
        yield key, getattr(getattr(params, section), name)


def check_folders(params: Params, root: Path = Path()) -> None:
    """Refuse a folder that shares files with an output of a stage: DVC removes outputs before a stage runs.

    Raises ParameterError, which names the key, the folder and the output.
    """
    outs = list(_outs(root / "dvc.yaml", dataclasses.asdict(params)))
    for key, folder in _folders(params):
        for stage, out in outs:
            if _overlap(root / folder, root / out):
                raise ParameterError(
                    f"{key}: {folder!r} shares files with {out}, which stage {stage} removes and writes anew;"
                    " it takes a folder that no stage writes to"
                )


def _outs(file: Path, values: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """(stage, path) of all that the stages of dvc.yaml write."""
    stages = read_yaml(file)["stages"] if file.is_file() else {}
    for name, stage in stages.items():
        stage = stage.get("do", stage)  # of a foreach stage
        for entry in (entry for kind in ("outs", "metrics", "plots") for entry in stage.get(kind, ())):
            path = entry if isinstance(entry, str) else next(iter(entry))
            yield name, _filled(os.path.join(stage.get("wdir", ""), path), values)


def _filled(path: str, values: dict[str, Any]) -> str:
    """A path of dvc.yaml with parameters filled in; where DVC alone knows what comes (${item}), the folder it is in."""

    def value(match: re.Match[str]) -> str:
        found: Any = values
        for name in match[1].strip().split("."):
            found = found.get(name) if isinstance(found, dict) else None
        return match[0] if found is None else str(found)

    known, unknown, _ = re.sub(r"\$\{([^}]*)\}", value, path).partition("${")
    return os.path.dirname(known) if unknown else known


def _overlap(one: Path, other: Path) -> bool:
    """Whether one path is the other or lies in it, as they are written or with links followed."""
    ones, others = ({Path(view(path)) for view in (os.path.abspath, os.path.realpath)} for path in (one, other))
    return any(_within(a, b) or _within(b, a) for a in ones for b in others)


def _within(inner: Path, outer: Path) -> bool:
    return any(_same(path, outer) for path in (inner, *inner.parents))


def _same(one: Path, other: Path) -> bool:
    """Whether two paths are one place: a file system may not tell cases apart, and may be mounted twice."""
    return one == other or (os.path.exists(one) and os.path.exists(other) and os.path.samefile(one, other))


def read_yaml(path: Path) -> Any:
    """A YAML file's content; ParameterError names the file and line where it is not YAML."""
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ParameterError(f"{path}: no such file") from None
    except OSError as error:
        raise ParameterError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ParameterError(f"{path}: not UTF-8: {error}") from None
    except yaml.YAMLError as error:
        raise ParameterError(f"{path}: not YAML: {' '.join(str(error).split())}") from None


class Declared:
    """The parameters that one stage declares in dvc.yaml, and no others.

    `load("train", "fcn", "0")` gives an object whose attributes are the declared top-level keys (`params.train`, ...);
    `network.${item.network}` is given as `params.network`, and the items of the matrix as `params.items`.
    """

    def __init__(self, stage: str, values: dict[str, Any], compute: Compute, items: tuple[str, ...] = ()):
        self.__dict__.update(values, compute=compute, stage=stage, items=items)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # what copying and pickling ask for
            raise AttributeError(name)
        raise ParameterError(f"{name}: stage {self.__dict__['stage']} does not declare this key in dvc.yaml")


def load(stage: str, *items: str, root: Path = Path()) -> Declared:
    """Validate the whole of params.yaml and hand a stage the keys it declares; items: those of its matrix.

    `compute` comes along undeclared, since it cannot change a result.
    """
    params = validate(read_yaml(root / "params.yaml"))
    check_folders(params, root)
    declared = read_yaml(root / "dvc.yaml")["stages"][stage].get("params", [])
    values: dict[str, Any] = {}
    for key in declared:
        name, _, rest = key.partition(".")
        value = getattr(params, name)
        if rest:
            if rest != "${item.network}" or not items:
                raise ParameterError(f"{key}: stage {stage} may declare whole sections and network.${{item.network}}")
            if items[0] not in value:
                raise ParameterError(f"network.{items[0]}: missing")
            value = value[items[0]]
        values[name] = value
    return Declared(stage, values, params.compute, items)
