"""One recorded trial as a plain record, whoever made it: what was seen, commanded, reached, and whether it held."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from graspfn.planning.methods import METHODS

METADATA = "graspfn.trial"  # name of the MCAP metadata record
METADATA_KEYS = {
    "object": "name of the object",
    "placement": "name or number of the placement of that object",
    "method": " | ".join(METHODS),
    "network": "name of the network, empty for Centroid",
    "sigma_uv_mm": "std of the reached position in this condition, mm",
    "sigma_theta_deg": "std of the reached angle in this condition, degrees",
    "simulated": "true | false",
}
PLANNED = "planned"  # a key that a recording may have: "false" where the method found no grasp, and nothing was tried
FRAME = "table"  # of recorded poses: origin on the table at the image centre, x along image +x, y along -y, z up


class RecordingError(ValueError):
    """A recording that cannot be used: one line naming the file and what is wrong or missing."""


@dataclass(frozen=True)
class Condition:
    """What was tried: the metadata record of a recording."""

    object: str
    placement: str
    method: str
    network: str
    sigma_uv_mm: float
    sigma_theta_deg: float
    simulated: bool

    def to_metadata(self) -> dict[str, str]:
        """Every field as text."""
        return {
            "object": self.object,
            "placement": self.placement,
            "method": self.method,
            "network": self.network,
            "sigma_uv_mm": repr(float(self.sigma_uv_mm)),
            "sigma_theta_deg": repr(float(self.sigma_theta_deg)),
            "simulated": "true" if self.simulated else "false",
        }

    @classmethod
    def from_metadata(cls, text: dict[str, str]) -> Condition:
        """Inverse of `to_metadata`; RecordingError says which key is missing or what one takes."""
        missing = [f"{key} ({meaning})" for key, meaning in METADATA_KEYS.items() if key not in text]
        if missing:
            raise RecordingError(f"metadata record {METADATA!r} lacks {', '.join(missing)}")
        if text["method"] not in METHODS:
            raise RecordingError(f"metadata method: {text['method']!r} is not one of {', '.join(METHODS)}")
        if text["simulated"] not in ("true", "false"):
            raise RecordingError(f"metadata simulated: {text['simulated']!r} is neither true nor false")
        return cls(
            object=text["object"],
            placement=text["placement"],
            method=text["method"],
            network=text["network"],
            sigma_uv_mm=_sigma(text, "sigma_uv_mm"),
            sigma_theta_deg=_sigma(text, "sigma_theta_deg"),
            simulated=text["simulated"] == "true",
        )


def was_planned(text: dict[str, str]) -> bool:
    """Whether the trial of a metadata record had a grasp to try: so it was unless it says otherwise."""
    value = text.get(PLANNED, "true")
    if value not in ("true", "false"):
        raise RecordingError(f"metadata {PLANNED}: {value!r} is neither true nor false")
    return value == "true"


def _sigma(text: dict[str, str], key: str) -> float:
    try:
        value = float(text[key])
    except ValueError:
        value = math.nan
    if not 0 <= value < math.inf:
        raise RecordingError(f"metadata {key}: {text[key]!r} is not {METADATA_KEYS[key]}")
    return value


@dataclass(frozen=True, eq=False)
class TrialRecording:
    """One trial.

    depth: (height, width) float32, metres, NaN where nothing was measured: the image that was planned on.
    camera_matrix: (3, 3) of that image; distortion: of its lens, as `imaging.camera.Camera` has it.
    commanded, achieved: (3,) poses (u [m], v [m], theta [rad]); None where the method found no grasp: a failure.
    joint_time_s: (T,) since the command; joint_positions: (T, len(joint_names)), metres or radians.
    success: the object was off the table and in the gripper at the top.
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
