"""The committed gripper and physics, for tests that build worlds of their own."""

from __future__ import annotations

from pathlib import Path

from graspfn.params import read_yaml, validate

PARAMS = validate(read_yaml(Path(__file__).parents[1] / "params.yaml"))
PHYSICS, GRIPPER, ATTEMPT, SETTLE = PARAMS.physics, PARAMS.gripper, PARAMS.attempt, PARAMS.settle
