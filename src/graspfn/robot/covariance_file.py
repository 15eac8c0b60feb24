"""Sigma as a file: what an analysis of recordings found, for `graspfn plan --covariance`, people, other programs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from graspfn.robot.analyse import Measured
from graspfn.robot.spread import AXES, PAIRS, Estimate
from graspfn.robot.trial import RecordingError
from graspfn.workflow.files import atomic

UNITS = {"u": "mm", "v": "mm", "theta": "deg"}
HEADER = """\
# Pose uncertainty of the gripper: reached less commanded pose, as it closes. u along the image's +x, v along its +y
# (down), theta from +u towards +v. `covariance` is of (u, v, theta), about the mean of each session; a constant offset
# is `bias`, which no wider covariance describes: correct it. [value, low, high]: 95% interval.
"""


def _numbers(estimate: Estimate) -> list[float | None]:
    return [_number(value) for value in (estimate.value, estimate.low, estimate.high)]


def _number(value: float) -> float | None:
    return float(f"{value:.6g}") if np.isfinite(value) else None


def file_name(label: str) -> str:
    """Of a condition: 6.2mm-4.7deg-injected.yaml."""
    return re.sub(r"[^\w.]+", "-", label.replace(" mm", "mm").replace("°", "deg")) + ".yaml"


def content(measured: Measured) -> dict[str, Any]:
    found = measured.spread
    return {
        "condition": measured.label,
        "units": dict(UNITS),
        "covariance": [[_number(value) for value in row] for row in found.covariance],
        "sigma": {axis: _numbers(found.sigma[i]) for i, axis in enumerate(AXES)} | {"uv": _numbers(found.sigma_uv)},
        "correlation": {
            f"{AXES[i]}, {AXES[j]}": _numbers(one) for (i, j), one in zip(PAIRS, found.correlation, strict=True)
        },
        "bias": {axis: _numbers(found.bias[i]) for i, axis in enumerate(AXES)},
        "sigma_between_sessions": {axis: _number(found.sessions_sigma[i]) for i, axis in enumerate(AXES)},
        "normality_p": _number(found.normality),
        "trials": found.rows,
        "sessions": found.sessions,
        "outliers": list(measured.outliers),
    }


def write_covariance(path: Path, measured: Measured) -> None:
    with atomic(path) as part:
        text = yaml.safe_dump(
            content(measured), sort_keys=False, allow_unicode=True, default_flow_style=None, width=100
        )
        part.write_text(HEADER + text, encoding="utf-8")


def read_covariance(path: Path) -> np.ndarray:
    """(3, 3) of (u [m], v [m], theta [rad]) from such a file.

    RecordingError unless it is a covariance, in the units that the file has to state.
    """
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
        units, S = values["units"], np.array(values["covariance"], dtype=float)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, KeyError, TypeError, ValueError):
        raise RecordingError(f"{path}: takes YAML with units and a covariance of 3 rows of 3 numbers") from None
    scales = {"mm": 1e-3, "m": 1.0, "deg": np.pi / 180, "rad": 1.0}
    if not isinstance(units, dict) or set(units) != set(AXES) or not set(units.values()) <= set(scales):
        raise RecordingError(f"{path}: units: takes u and v in mm or m, theta in deg or rad")
    if {units["u"], units["v"]} & {"deg", "rad"} or units["theta"] in ("mm", "m"):
        raise RecordingError(f"{path}: units: takes u and v in mm or m, theta in deg or rad")
    if S.shape != (3, 3) or not np.isfinite(S).all() or not np.allclose(S, S.T, rtol=1e-4, atol=1e-9):
        raise RecordingError(f"{path}: covariance: takes a symmetric matrix of 3 rows of 3 numbers")
    if np.linalg.eigvalsh((S + S.T) / 2).min() < -1e-4 * np.trace(S):
        raise RecordingError(f"{path}: covariance: has a direction of negative variance")
    scale = np.array([scales[units[axis]] for axis in AXES])
    return (S + S.T) / 2 * np.outer(scale, scale)
