"""Sigma in a file that states its units: what an analysis of recordings wrote, or people did."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

from graspfn.planning.uncertainty import AXES, PlanningError, check_covariance

LENGTHS, ANGLES = {"mm": 1e-3, "m": 1.0}, {"deg": np.pi / 180, "rad": 1.0}


def read_covariance(path: Path) -> np.ndarray:
    """(3, 3) of (u [m], v [m], theta [rad]).

    PlanningError unless the file has a covariance, in the units that it has to state.
    """
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
        units, covariance = values["units"], values["covariance"]
    except OSError as error:
        raise PlanningError(f"{path}: cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, ValueError, RecursionError, KeyError, TypeError):  # no UTF-8 is a ValueError
        raise PlanningError(f"{path}: takes YAML with units and a covariance of 3 rows of 3 numbers") from None
    try:
        scale = np.array([(ANGLES if axis == "theta" else LENGTHS)[units[axis]] for axis in AXES])
    except (KeyError, TypeError):
        raise PlanningError(f"{path}: units: takes u and v in mm or m, theta in deg or rad") from None
    try:
        return check_covariance(check_covariance(covariance) * np.outer(scale, scale))
    except PlanningError as error:
        raise PlanningError(f"{path}: {error}") from None
