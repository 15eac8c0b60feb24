"""What becomes of plans when the depth image is disturbed, with the table found in it or believed: ours, no table of
the paper."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from graspfn.evaluation.bench import Bench, Scene
from graspfn.evaluation.expected import Attempts
from graspfn.evaluation.planner import (
    NOTHING,
    TRUE,
    UNTRAINED,
    GraspFunction,
    Planned,
    Planner,
    View,
    true_function,
    view,
)
from graspfn.evaluation.trials import Line, columns_of, errors_of, expectation
from graspfn.geometry import grid
from graspfn.geometry.transforms import T_world_scene
from graspfn.imaging.camera import Camera
from graspfn.imaging.disturbances import CLEAN, Shot, shots
from graspfn.imaging.height_map import HeightMap
from graspfn.imaging.holes import DepthError
from graspfn.imaging.renderers import renderer
from graspfn.learning.networks import GraspNetwork
from graspfn.learning.prediction import predict
from graspfn.meshes.placed import Resting
from graspfn.params import Disturb, Noise, Table
from graspfn.physics.world import Rig
from graspfn.planning.uncertainty import PoseUncertainty

NEAR_M, NEAR_RAD = 0.01, np.radians(15)  # a plan that has moved no further is taken to have stayed
Q = np.ndarray | None


@dataclass(frozen=True)
class Conditions:
    """How every scene is seen, planned on and tried. others: further cameras by name, each with its noise."""

    rig: Rig
    planner: Planner
    camera: Camera
    renderer: str
    table: Table
    noise: Noise
    others: Mapping[str, tuple[Camera, Noise]]
    disturb: Disturb
    seed: int

    @property
    def uncertainty(self) -> PoseUncertainty:
        return PoseUncertainty.of(self.disturb.sigma_uv_mm, self.disturb.sigma_theta_deg)


@dataclass(frozen=True, eq=False)
class Case:
    """One scene: the object at its placement, None for an empty table, and what its labels know of it.

    attempts: of the labels, None where it has none.
    """

    name: str
    resting: Resting | None
    shift_uv: np.ndarray
    theta: float
    attempts: Attempts | None

    def scene(self, seen: HeightMap) -> Scene:
        return Scene(self.name, seen, self.shift_uv, self.theta)


@dataclass(frozen=True)
class Plan(Line):
    """One line of data/robustness.parquet: one plan, and what came of it.

    stays: whether it is where the plan on the clean image is, with the same way to have the table. highest: of the
    network's scores, wherever the pose; NaN for Centroid. refused: why the image was not planned on, "" where it was.
    held: of the trials in simulation.
    """

    empty: bool
    disturbance: str
    amount: float
    unit: str
    table_fit: bool
    stays: bool
    highest: float
    refused: str
    held: int
    trials: int


@dataclass(frozen=True, eq=False)
class Trained:
    """A network with its training seed and the `input` that it sees."""

    name: str
    seed: int
    kind: str
    network: GraspNetwork


@dataclass(frozen=True, eq=False)
class Look:
    """One shot with the table found or believed: a view of it for each kind of network, and what each network says.

    scores: by (network, training seed), (33, 44, 6). A network that sees depth images believes the camera's pose: it
    has no plans with the table found.
    """

    shot: Shot
    fit: bool
    views: dict[str, View]
    scores: dict[tuple[str, int], np.ndarray] = field(default_factory=dict)


def _look(shot: Shot, table: Table, kinds: set[str]) -> Look:
    kinds = {"height_map"} | (kinds - {"depth"} if table.fit else kinds)
    return Look(shot, table.fit, {kind: _view(shot, kind, table) for kind in kinds})


def _view(shot: Shot, kind: str, table: Table) -> View:
    """Also an image that does not look like its camera's is refused: no disturbance ends the stage."""
    try:
        return view(shot.depth, shot.camera, kind, table)
    except DepthError as error:
        return View(None, NOTHING, str(error))


def _predict(looks: Sequence[Look], networks: Sequence[Trained]) -> None:
    """What every network that is given an input says of each look."""
    for own in networks:
        given = [(look, look.views[own.kind].inputs) for look in looks if own.kind in look.views]
        shown = {look: inputs for look, inputs in given if inputs is not None}
        if shown:
            for look, f in zip(shown, predict(own.network, np.stack(list(shown.values()))), strict=True):
                look.scores[own.name, own.seed] = f


def near(one: Q, other: Q) -> bool:
    """Whether two plans (3,) are the same grasp, or neither is one."""
    if one is None or other is None:
        return one is other
    apart = np.hypot(*(one[:2] - other[:2]))
    return bool(apart <= NEAR_M and abs(grid.angle_difference(one[2], other[2])) <= NEAR_RAD)


class _Trials:
    """Tries plans in simulation, all by the same errors; a pose that comes again is known."""

    def __init__(self, case: Case, conditions: Conditions):
        self.sigma = conditions.uncertainty
        # Clean plans meet the errors of Table 1.
        self.errors = errors_of(case.name, conditions.disturb.errors_per_object, conditions.seed)
        self.bench = None
        if case.resting is not None:
            self.bench = Bench(case.resting, conditions.rig, case.scene(NOTHING))
        self.known: dict[bytes, bool] = {}

    def run(self, q: Q) -> tuple[int, int]:
        """How often the object was held, of how many trials."""
        if self.bench is None:
            return 0, 0
        if q is None:
            return 0, len(self.errors)
        held = 0
        for reached in self.sigma.reached(q, self.errors):
            key = reached.tobytes()
            if key not in self.known:
                self.known[key] = self.bench.grasp(reached).held
            held += self.known[key]
        return held, len(self.errors)


def _planned(
    case: Case, look: Look, networks: Sequence[Trained], conditions: Conditions
) -> Iterator[tuple[Planned, Scene, float, str]]:
    """Plans of all methods on a look, with the scene, the highest of the network's scores, and why there is none."""
    scene, gripper = case.scene(look.views["height_map"].seen), conditions.rig.gripper
    refused, highest, functions = {("", UNTRAINED): look.views["height_map"].refused}, {}, []
    for own in networks:
        if own.kind in look.views:
            key, seen = (own.name, own.seed), look.views[own.kind]
            f = look.scores.get(key, np.zeros(grid.SHAPE, np.float32))
            refused[key], highest[key] = seen.refused, float(f.max())
            functions.append(GraspFunction(*key, f).where_met(seen.seen, gripper))
    if look.fit and look.shot.disturbance == CLEAN and case.attempts is not None:  # no image moves what labels plan
        functions.append(true_function(case.attempts))
        highest[TRUE, UNTRAINED] = float(functions[-1].f.max())
    (plans,) = conditions.planner.plans(scene, functions, [conditions.uncertainty])
    for planned in plans:
        key = planned.network, planned.training_seed
        yield planned, scene, highest.get(key, float("nan")), refused.get(key, "")


def disturb_case(case: Case, conditions: Conditions, networks: Sequence[Trained]) -> list[Plan]:
    """Every plan on every shot of a scene, with the table found and believed; the clean ones first."""
    draw, resting = renderer(conditions.renderer), case.resting
    kinds = {own.kind for own in networks}

    def render(camera: Camera) -> np.ndarray:
        if resting is None:
            return camera.bare_table().astype(np.float32)
        T = T_world_scene(case.shift_uv, case.theta) @ resting.T_world_object
        return draw(resting.mesh, T, camera)

    c = conditions
    taken = shots(render, c.camera, c.noise, c.others, c.disturb, c.seed, case.name)
    tables = [dataclasses.replace(c.table, fit=fit) for fit in (True, False)]
    looks = [_look(shot, table, kinds) for shot in taken for table in tables]
    _predict(looks, networks)
    trials, lines = _Trials(case, conditions), []
    clean: dict[tuple[bool, str, str, int], Q] = {}
    for look in looks:
        for planned, scene, highest, refused in _planned(case, look, networks, conditions):
            key = look.fit, planned.method, planned.network, planned.training_seed
            before = clean.setdefault(key, planned.q)
            expected = expectation(scene, planned, conditions.uncertainty, case.attempts)
            held, tried = trials.run(planned.q)
            lines.append(
                Plan(
                    **columns_of(case.name, planned, expected),
                    empty=resting is None,
                    disturbance=look.shot.disturbance,
                    amount=float(look.shot.amount),
                    unit=look.shot.unit,
                    table_fit=look.fit,
                    stays=near(planned.q, before),
                    highest=highest,
                    refused=refused,
                    held=held,
                    trials=tried,
                )
            )
    return lines
