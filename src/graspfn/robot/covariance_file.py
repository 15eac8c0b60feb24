"""Sigma as a file: what an analysis of recordings found, for `graspfn plan --covariance`, people, other programs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from graspfn.robot.analyse import Measured
from graspfn.robot.spread import AXES, PAIRS, Estimate
from graspfn.workflow.files import atomic

UNITS = {"u": "mm", "v": "mm", "theta": "deg"}
HEADER = """\
# Pose uncertainty of the gripper: reached less commanded pose, as it closes. u along the image's +x, v along its +y
# (down), theta from +u towards +v. `covariance` is of (u, v, theta), about the mean of each session; a constant offset
# is `bias`, which no wider covariance describes: correct it. [value, low, high]: 95% interval.
"""


def _numbers(estimate: Estimate) -> list[float | None]:
    return [_number(value) for value in (estimate.value, estimate.low, estimate.high)]


def _number(value: float, digits: int = 6) -> float | None:
    return float(f"{value:.{digits}g}") if np.isfinite(value) else None


def file_name(label: str) -> str:
    """Of a condition: 6.2mm-4.7deg-injected.yaml."""
    return re.sub(r"[^\w.]+", "-", label.replace(" mm", "mm").replace("°", "deg")) + ".yaml"


def content(measured: Measured) -> dict[str, Any]:
    found = measured.spread
    return {
        "condition": measured.label,
        "units": dict(UNITS),
        "covariance": [[_number(value, 12) for value in row] for row in found.covariance],  # singular ones stay so
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
