"""Simulated trials of Table 1 (paper VII-A): plan on a noisy image, miss the pose by the uncertainty, grasp in DART."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from graspfn.evaluation.bench import Bench, Scene
from graspfn.evaluation.ceiling import ceilings
from graspfn.evaluation.expected import UNKNOWN, Attempts, Expected, expected_under
from graspfn.evaluation.planner import TRUE, GraspFunction, Planned, Planner
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.seeds import generator

NO_GRASP = "no grasp"  # outcome of a trial without a pose to try: a failure
NOWHERE = np.full(3, np.nan)


@dataclass(frozen=True)
class Line:
    """What tables say of every plan.

    u_m, v_m, theta_rad: the commanded pose; expected: its success by the object's own attempts, with its standard error
    and the attempts that it rests on; of Table 1's true function that of poses planned without the attempts that judge
    them, its error too small by up to a third (`ceiling`). NaN where there is none.
    """

    id: str
    method: str
    network: str
    training_seed: int
    u_m: float
    v_m: float
    theta_rad: float
    expected: float
    expected_error: float
    effective: float


@dataclass(frozen=True)
class Trial(Line):
    """One line of data/trials.parquet.

    error: which of the object's draws was missed by; promise: the robust score of the commanded pose, by the function
    that planned it, NaN where there is none.
    """

    sigma_uv_mm: float
    sigma_theta_deg: float
    error: int
    reached_u_m: float
    reached_v_m: float
    reached_theta_rad: float
    success: bool
    outcome: str
    promise: float


def trials_of_object(
    scene: Scene,
    bench: Bench,
    planner: Planner,
    functions: Sequence[GraspFunction],
    cells: Sequence[tuple[float, float]],
    errors: np.ndarray,
    attempts: Attempts | None,
) -> list[Trial]:
    """Trials of every method in every cell (sigma_uv [mm], sigma_theta [deg]), one for each error.

    errors: (n, 3) standard normal draws, which all methods and, scaled, all cells share: they are paired. A method that
    finds no grasp fails. attempts: those of the object's labels, None where it has none.
    """
    uncertainties = [PoseUncertainty.of(*cell) for cell in cells]
    plans = planner.plans(scene, functions, uncertainties)
    by_labels = [{}] * len(cells) if attempts is None else ceilings(scene, planner, uncertainties, attempts)
    found: list[Trial] = []
    for cell, uncertainty, of_cell, own in zip(cells, uncertainties, plans, by_labels, strict=True):
        for planned in of_cell:
            if planned.network == TRUE:
                expected = own.get(planned.method, UNKNOWN)
            else:
                expected = expectation(scene, planned, uncertainty, attempts)
            found += _trials(scene, bench, planned, cell, uncertainty, errors, expected)
    return found


def _trials(
    scene: Scene,
    bench: Bench,
    planned: Planned,
    cell: tuple[float, float],
    uncertainty: PoseUncertainty,
    errors: np.ndarray,
    expected: Expected,
) -> Iterator[Trial]:
    for i, error in enumerate(errors):
        reached, held, outcome = NOWHERE, False, NO_GRASP
        if planned.q is not None:
            reached = uncertainty.reached(planned.q, error)
            result = bench.grasp(reached)
            held, outcome = result.held, result.outcome.value
        yield Trial(
            **columns_of(scene.name, planned, expected),
            sigma_uv_mm=cell[0],
            sigma_theta_deg=cell[1],
            error=i,
            **dict(zip(("reached_u_m", "reached_v_m", "reached_theta_rad"), reached.tolist(), strict=True)),
            success=held,
            outcome=outcome,
            promise=planned.promise,
        )


def columns_of(name: str, planned: Planned, expected: Expected) -> dict[str, Any]:
    """The columns of a `Line`."""
    u, v, theta = (NOWHERE if planned.q is None else planned.q).tolist()
    return {
        "id": name,
        "method": planned.method,
        "network": planned.network,
        "training_seed": planned.training_seed,
        "u_m": u,
        "v_m": v,
        "theta_rad": theta,
        "expected": expected.value,
        "expected_error": expected.error,
        "effective": expected.effective,
    }


def errors_of(name: str, count: int, seed: int) -> np.ndarray:
    """(count, 3) standard normal draws, by which the gripper misses whatever is planned in a scene."""
    return generator(seed, "evaluate", name).standard_normal((count, 3))


def expectation(scene: Scene, planned: Planned, uncertainty: PoseUncertainty, attempts: Attempts | None) -> Expected:
    """What the object's attempts say; nothing of its true function, which was made of them (but see `ceilings`)."""
    if planned.q is None or attempts is None or planned.network == TRUE:
        return UNKNOWN
    return expected_under(scene.unmoved(planned.q), uncertainty, attempts)
