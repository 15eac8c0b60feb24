"""One recorded trial as a plain record, whoever made it: what was seen, commanded, reached, and whether it held."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from graspfn.planning.methods import METHODS

METADATA = "graspfn.trial"  # name of the MCAP metadata record
REQUIRED = {
    "object": "name of the object",
    "placement": "name or number of the placement of that object",
    "method": " | ".join(METHODS),
    "network": "name of the network, empty for Centroid",
    "sigma_uv_mm": "std of the position that the planner assumed, mm",
    "sigma_theta_deg": "std of the angle that the planner assumed, degrees",
    "simulated": "true | false",
}
OPTIONAL = {
    "injected_uv_mm": "std of the error added to the position on purpose, mm; left out where it is not known",
    "injected_theta_deg": "std of the error added to the angle on purpose, degrees; left out where it is not known",
    "session": "trials since the arm or camera was last set up or calibrated",
    "verdict": "held | failed, over what topics.outcome says",
    "planned": "true | false: whether the method found a grasp; false: nothing was tried",
    "u_mm": "commanded pose, mm, over topics.commanded",
    "v_mm": "commanded pose, mm",
    "theta_deg": "commanded pose, degrees",
    "reached_u_mm": "where the gripper was as it closed, measured from outside, mm (arm.achieved: columns)",
    "reached_v_mm": "measured, mm",
    "reached_theta_deg": "measured, degrees",
}
KEYS = REQUIRED | OPTIONAL
INJECTED = ("injected_uv_mm", "injected_theta_deg")
PLANNED = "planned"
FRAME = "table"  # of recorded poses: origin on the table at the image centre, x along image +x, y along -y, z up


class RecordingError(ValueError):
    """A recording that cannot be used: one line naming the file and what is wrong or missing."""


@dataclass(frozen=True)
class Condition:
    """What was tried. sigma: the uncertainty that the planner assumed. injected: what was added on purpose, None where
    nobody knows. Neither is what the recordings show."""

    object: str
    placement: str
    method: str
    network: str
    sigma_uv_mm: float
    sigma_theta_deg: float
    simulated: bool
    injected_uv_mm: float | None = None
    injected_theta_deg: float | None = None
    session: str = ""

    def to_metadata(self) -> dict[str, str]:
        """Every field that is known as text."""
        text = {name: getattr(self, name) for name in ("object", "placement", "method", "network")}
        text |= {name: repr(float(getattr(self, name))) for name in ("sigma_uv_mm", "sigma_theta_deg")}
        text["simulated"] = "true" if self.simulated else "false"
        injected = {name: getattr(self, name) for name in INJECTED}
        text |= {name: repr(float(value)) for name, value in injected.items() if value is not None}
        return text | ({"session": self.session} if self.session else {})

    @classmethod
    def from_metadata(cls, text: Mapping[str, str]) -> Condition:
        """Inverse of `to_metadata`; RecordingError says which key is missing or what one takes."""
        missing = [f"{key} ({meaning})" for key, meaning in REQUIRED.items() if key not in text]
        if missing:
            raise RecordingError(f"what the trial was lacks {', '.join(missing)}")
        check(text)
        injected = [float(text[key]) for key in INJECTED if key in text]
        if len(injected) == 1:
            raise RecordingError("has one of injected_uv_mm and injected_theta_deg; it takes both or neither")
        return cls(
            object=text["object"],
            placement=text["placement"],
            method=text["method"],
            network=text["network"],
            sigma_uv_mm=float(text["sigma_uv_mm"]),
            sigma_theta_deg=float(text["sigma_theta_deg"]),
            simulated=text["simulated"] == "true",
            injected_uv_mm=injected[0] if injected else None,
            injected_theta_deg=injected[1] if injected else None,
            session=text.get("session", ""),
        )


def check(text: Mapping[str, str]) -> None:
    """RecordingError where a value of what a trial was is none that its key takes."""
    for key, value in text.items():
        if key not in KEYS:
            raise RecordingError(f"{key}: no such key; what a trial was takes {', '.join(KEYS)}")
        if key == "method" and value not in METHODS:
            raise RecordingError(f"method: {value!r} is not one of {', '.join(METHODS)}")
        if key in ("simulated", PLANNED) and value not in ("true", "false"):
            raise RecordingError(f"{key}: {value!r} is neither true nor false")
        if key == "verdict" and value not in ("held", "failed"):
            raise RecordingError(f"verdict: {value!r} is neither held nor failed")
        if key.endswith(("_mm", "_deg")):
            number = _number(value)
            least = 0.0 if key.startswith(("sigma", "injected")) else -math.inf
            if not least <= number < math.inf or number == -math.inf:
                raise RecordingError(f"{key}: {value!r} is not {KEYS[key]}")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def was_planned(text: Mapping[str, str]) -> bool:
    """Whether the trial had a grasp to try: so it was unless it says otherwise."""
    return text.get(PLANNED, "true") == "true"


def pose_of(text: Mapping[str, str], prefix: str = "") -> np.ndarray | None:
    """(3,) pose (u [m], v [m], theta [rad]) in what a trial was; None without one."""
    keys = [f"{prefix}{name}" for name in ("u_mm", "v_mm", "theta_deg")]
    given = [key for key in keys if key in text]
    if not given:
        return None
    if len(given) < 3:
        raise RecordingError(f"has {', '.join(given)} alone; it takes all of {', '.join(keys)}")
    u, v, theta = (float(text[key]) for key in keys)
    return np.array([u / 1000, v / 1000, math.radians(theta) % math.pi])


@dataclass(frozen=True, eq=False)
class TrialRecording:
    """One trial.

    depth: (height, width) float32, metres, NaN where nothing was measured: the image that was planned on.
    camera_matrix: (3, 3) of that image; distortion: of its lens, as `imaging.camera.Camera` has it.
    commanded, achieved: (3,) poses (u [m], v [m], theta [rad]); None where the method found no grasp: a failure.
    achieved is None too where the arm was stopped before its fingers closed.
    joint_time_s: (T,) since the command; joint_positions: (T, len(joint_names)), metres or radians.
    success: the object was off the table and in the gripper at the top.
    judged: the same from fingers and lift (`judged.judge`), None where they do not tell; why: they say that it failed.
    lift_m: (L,) height of the gripper above the table at lift_time_s (L,) since the command; empty where it was not
    asked for, or TF lacks.
    flags: what is odd about the recording, a line each. doubts: what is wrong with `achieved`, so that it measures
    nothing.
    """

    condition: Condition
    depth: np.ndarray
    camera_matrix: np.ndarray
    commanded: np.ndarray | None
    achieved: np.ndarray | None
    joint_names: tuple[str, ...]
    joint_time_s: np.ndarray
    joint_positions: np.ndarray
    success: bool
    distortion: tuple[float, ...] = ()
    flags: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    judged: bool | None = None
    why: str = ""
    lift_time_s: np.ndarray = field(default_factory=lambda: np.zeros(0))
    lift_m: np.ndarray = field(default_factory=lambda: np.zeros(0))
