"""What becomes of plans when the depth image is disturbed, with the table found in it or believed: ours, no table of
the paper."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from graspfn.evaluation.bench import Bench, Scene
from graspfn.evaluation.expected import Attempts
from graspfn.evaluation.planner import GraspFunction, Planned, Planner, true_function
from graspfn.evaluation.trials import columns_of, errors_of, expectation
from graspfn.geometry import grid
from graspfn.geometry.transforms import T_world_scene
from graspfn.imaging.camera import Camera
from graspfn.imaging.disturbances import CLEAN, Shot, shots
from graspfn.imaging.height_map import SHAPE, HeightMap, see_heights
from graspfn.imaging.holes import DepthError
from graspfn.imaging.network_input import height_map_input, network_input
from graspfn.imaging.renderers import renderer
from graspfn.imaging.table import TableError
from graspfn.learning.networks import GraspNetwork
from graspfn.learning.prediction import predict
from graspfn.meshes.placed import Resting
from graspfn.params import Disturb, Noise, Table
from graspfn.physics.world import Rig
from graspfn.planning.methods import BEST, CENTROID, ROBUST
from graspfn.planning.uncertainty import PoseUncertainty

NOTHING = HeightMap(np.zeros(SHAPE, np.float32), np.zeros(SHAPE, bool))  # seen where an image is refused
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

    attempts: of the labels, None where it has none. tried: whether the plans are tried in simulation.
    """

    name: str
    resting: Resting | None
    shift_uv: np.ndarray
    theta: float
    attempts: Attempts | None
    tried: bool

    def scene(self, seen: HeightMap) -> Scene:
        return Scene(self.name, seen, self.shift_uv, self.theta)


@dataclass(frozen=True)
class Plan:
    """One line of data/robustness.parquet: one plan, and what came of it.

    stays: whether it is where the plan on the clean image is, with the same way to have the table. highest: the score
    of the network's best pose, NaN for Centroid. refused: why there was nothing to plan on, "" where there was. held:
    of the trials in simulation. expected, expected_error, effective: as in `trials.Trial`.
    """

    id: str
    empty: bool
    disturbance: str
    amount: float
    unit: str
    table_fit: bool
    method: str
    network: str
    training_seed: int
    u_m: float
    v_m: float
    theta_rad: float
    stays: bool
    highest: float
    refused: str
    held: int
    trials: int
    expected: float
    expected_error: float
    effective: float


@dataclass(frozen=True, eq=False)
class Trained:
    """A network with its training seed and the `input` that it sees."""

    name: str
    seed: int
    kind: str
    network: GraspNetwork


@dataclass(frozen=True, eq=False)
class View:
    """One shot with the table found or believed: the map that Centroid sees, and inputs by kind of network.

    refused: by kind, why there is no input.
    """

    shot: Shot
    fit: bool
    seen: HeightMap | None
    inputs: dict[str, np.ndarray]
    refused: dict[str, str]


def _view(shot: Shot, table: Table, kinds: set[str]) -> View:
    inputs, refused, seen = {}, {}, None
    try:
        seen = see_heights(shot.depth, shot.camera, table)
        inputs["height_map"] = height_map_input(seen)
    except (DepthError, TableError) as error:
        refused["height_map"] = str(error)
    if "depth" in kinds:
        try:
            inputs["depth"] = network_input(shot.depth, shot.camera, "depth", table)
        except DepthError as error:
            refused["depth"] = str(error)
    return View(shot, table.fit, seen, inputs, refused)


def _functions(views: Sequence[View], networks: Sequence[Trained]) -> list[list[GraspFunction]]:
    """What every network that is given an input says of each view."""
    found: list[list[GraspFunction]] = [[] for _ in views]
    for own in networks:
        places = [i for i, view in enumerate(views) if own.kind in view.inputs]
        if places:
            scores = predict(own.network, np.stack([views[i].inputs[own.kind] for i in places]))
            for i, f in zip(places, scores, strict=True):
                found[i].append(GraspFunction(own.name, own.seed, f))
    return found


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
        if case.tried and case.resting is not None:
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
    case: Case,
    view: View,
    functions: Sequence[GraspFunction],
    networks: Sequence[Trained],
    conditions: Conditions,
) -> Iterator[tuple[Planned, Scene, float, str]]:
    """Plans of all methods on a view, with the scene, the score of the network's best pose, and why there is none.

    A network that sees depth images believes the camera's pose: it has no plans with the table found.
    """
    scene = case.scene(view.seen or NOTHING)
    wanted = {(own.name, own.seed): own.kind for own in networks if own.kind != "depth" or not view.fit}
    given = [f for f in functions if (f.network, f.training_seed) in wanted]
    once = view.fit and view.shot.disturbance == CLEAN  # no image moves what labels plan
    own = [true_function(case.attempts)] if once and case.attempts is not None else []
    highest = {(f.network, f.training_seed): float(f.f.max()) for f in given + own}
    (plans,) = conditions.planner.plans(scene, given + own, [conditions.uncertainty])
    for planned in plans:
        refused = view.refused.get("height_map", "") if planned.method == CENTROID else ""
        yield planned, scene, highest.get((planned.network, planned.training_seed), float("nan")), refused
    for (name, seed), kind in wanted.items():
        if kind in view.refused:
            for method in (BEST, ROBUST):
                yield Planned(method, name, seed, None), scene, 0.0, view.refused[kind]


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
    views = [_view(shot, table, kinds) for shot in taken for table in tables]
    trials, lines = _Trials(case, conditions), []
    clean: dict[tuple[bool, str, str, int], Q] = {}
    for view, functions in zip(views, _functions(views, networks), strict=True):
        for planned, scene, highest, refused in _planned(case, view, functions, networks, conditions):
            key = view.fit, planned.method, planned.network, planned.training_seed
            before = clean.setdefault(key, planned.q)
            expected = expectation(scene, planned, conditions.uncertainty, case.attempts)
            held, tried = trials.run(planned.q)
            lines.append(
                Plan(
                    id=case.name,
                    empty=resting is None,
                    disturbance=view.shot.disturbance,
                    amount=float(view.shot.amount),
                    unit=view.shot.unit,
                    table_fit=view.fit,
                    stays=near(planned.q, before),
                    highest=highest,
                    refused=refused,
                    held=held,
                    trials=tried,
                    **columns_of(planned, expected),
                )
            )
    return lines
