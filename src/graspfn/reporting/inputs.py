"""What a report is made of, and reading it from the files that the stages wrote."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from graspfn.evaluation.cases import read_functions
from graspfn.evaluation.planner import view
from graspfn.imaging.camera import Camera
from graspfn.imaging.holes import fill_holes
from graspfn.imaging.noise import observe
from graspfn.meshes.placed import load_resting, read_resting, resting_rows
from graspfn.meshes.store import read_manifest
from graspfn.physics.world import Rig
from graspfn.planning.objects import where_met
from graspfn.reporting.failures import page_path, some
from graspfn.reporting.figures.depth_images import ExecutedGrasp
from graspfn.reporting.film import Film, film_best_grasp, film_failure
from graspfn.reporting.parameters import Parameter, flat_parameters
from graspfn.reporting.plans import graspable_objects, plans_of
from graspfn.reporting.sizes import widths
from graspfn.robot.described import read_tables
from graspfn.robot.places import camera_of
from graspfn.robot.read import read_trial
from graspfn.robot.source import source_of
from graspfn.robot.trial import TrialRecording
from graspfn.seeds import generator
from graspfn.workflow.files import read_npz

SPLITS = ("train", "test")
SHOWN_TEST, SHOWN_GRASPS, SHOWN_FILMS, SHOWN_FAILURES = 4, 8, 10, 3
FAILURES = "robot_failures"  # in the folder of the data: a page for each failed trial


@dataclass(frozen=True, eq=False)
class LabelledExample:
    """A training object: depth and noisy (480, 640), metres; f (33, 44, 6) in [0, 1]."""

    id: str
    depth: np.ndarray
    noisy: np.ndarray
    f: np.ndarray


@dataclass(frozen=True, eq=False)
class PredictedExample:
    """A test object: noise-free depth (480, 640), metres; each network's function (33, 44, 6) in [0, 1], and what of it
    is planned on, 0 where the gripper does not meet the object."""

    id: str
    depth: np.ndarray
    functions: dict[str, np.ndarray]
    planned_on: dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Recorded:
    """From the recordings: one depth image as it came and filled (height, width), and some successful grasps.

    camera: what took them, which need not be the camera of the parameters.
    """

    camera: Camera
    raw: np.ndarray
    filled: np.ndarray
    grasps: tuple[ExecutedGrasp, ...]


@dataclass(frozen=True)
class FailedTrial:
    """The page of a failed trial, by the name of its bag."""

    file: str
    png: bytes


@dataclass(frozen=True, eq=False)
class ReportInputs:
    """Everything a report shows. Tables have the columns of the stage that wrote them.

    manifests and placed: by split. rejects (split, source, name, class, reason): meshes turned down.
    account, test_account: of the labels of training and test objects; graspable: those of the test objects that can be
    held; widths_m: the narrowest width of each as it was placed, by id. plans: the trials, those of one pose together.
    disturbed: plans on disturbed images.
    films: of several objects, by whether they are "held" or "failed".
    data: where the objects' meshes and poses lie, too many to hold. stage_seconds: how long each stage took, for those
    where it is known.
    params: the sections of params.yaml, but for compute.
    """

    data: Path
    params: Any
    parameters: tuple[Parameter, ...]
    camera: Camera
    manifests: Mapping[str, pd.DataFrame]
    placed: Mapping[str, pd.DataFrame]
    rejects: pd.DataFrame
    account: pd.DataFrame
    test_account: pd.DataFrame
    graspable: frozenset[str]
    widths_m: Mapping[str, float]
    pretraining: Mapping[str, pd.DataFrame]
    training: Mapping[str, pd.DataFrame]
    trials: pd.DataFrame
    plans: pd.DataFrame
    disturbed: pd.DataFrame
    robot_trials: pd.DataFrame
    robot_uncertainty: pd.DataFrame
    robot_unused: pd.DataFrame
    labelled: LabelledExample
    predicted: tuple[PredictedExample, ...]
    film: Film | None
    films: Mapping[str, Sequence[Film]]
    recorded: Recorded
    failures: tuple[FailedTrial, ...]
    stage_seconds: Mapping[str, float]

    @property
    def test_source(self) -> dict[str, str]:
        """Where each test object comes from, by id."""
        manifest = self.manifests["test"]
        return dict(zip(manifest["id"], manifest["source"], strict=True))


def spread(classes: pd.Series, count: int) -> list[int]:
    """Positions of `count` objects: the first of every class, then the second, ...; in turn over the sorted classes."""
    order = pd.DataFrame({"class": classes.to_numpy(), "position": np.arange(len(classes))})
    order["turn"] = order.groupby("class").cumcount()
    return order.sort_values(["turn", "class"])["position"].head(count).tolist()


def example_label(successes: np.ndarray) -> int:
    """Which object to show: the one at the third quartile of poses that ever held; successes: (N, 33, 44, 6)."""
    graspable = (successes > 0).reshape(len(successes), -1).sum(axis=1)
    return int(np.argsort(graspable, kind="stable")[(3 * (len(successes) - 1) + 2) // 4])


def _labelled(data: Path, labels: Mapping[str, np.ndarray], params: Any) -> LabelledExample:
    place = example_label(labels["successes"])
    name = str(labels["ids"][place])
    index = pd.read_parquet(data / "images/train.parquet").set_index("id")
    depth = np.array(np.load(data / "images/train.npy", mmap_mode="r")[index.loc[name, "row"]])
    f = labels["successes"][place] / float(labels["attempts"])
    return LabelledExample(name, depth, observe(depth, params.noise, params.seed, name), f)


def _predicted(data: Path, networks: dict[str, str], params: Any) -> tuple[PredictedExample, ...]:
    index = pd.read_parquet(data / "images/test.parquet")
    images = np.load(data / "images/test.npy", mmap_mode="r")
    predicted = {network: read_functions(data / f"functions/{run}.npz") for network, run in networks.items()}
    rows = [index["row"].tolist()[position] for position in spread(index["class"], SHOWN_TEST)]
    names = index.set_index("row")["id"]
    camera = Camera.from_params(params.camera)

    def planned_on(row: int, f: Mapping[str, np.ndarray]) -> np.ndarray:
        image = observe(images[row], params.noise, params.seed, names[row])
        return where_met(f["scores"][row], view(image, camera, str(f["input"]), params.table).seen, params.gripper)

    return tuple(
        PredictedExample(
            names[row],
            np.array(images[row]),
            {key: f["scores"][row] for key, f in predicted.items()},
            {key: planned_on(row, f) for key, f in predicted.items()},
        )
        for row in rows
    )


def _film(data: Path, labels: Mapping[str, np.ndarray], first: str, params: Any) -> Film | None:
    """The labelled example's object if a grasp of it holds, else the others, most successes first."""
    total = labels["successes"].reshape(len(labels["ids"]), -1).sum(axis=1, dtype=int)
    names = [str(labels["ids"][i]) for i in np.argsort(-total, kind="stable") if total[i]]
    names.sort(key=lambda name: name != first)
    placed = resting_rows(data / "placed/train.parquet")
    rig = Rig(params.physics, params.gripper, params.attempt)
    place = {str(name): i for i, name in enumerate(labels["ids"])}
    for name in names:
        resting = load_resting(data / "objects/train", data / "collision/train", placed[name])
        film = film_best_grasp(name, resting, labels["successes"][place[name]], rig)
        if film:
            return film
    return None


def _films(data: Path, labels: Mapping[str, np.ndarray], params: Any) -> dict[str, list[Film]]:
    """Up to SHOWN_FILMS attempts that held and as many that failed, of the first objects of different classes."""
    placed = read_resting(data / "placed/train.parquet")
    placed = placed[placed["id"].isin(labels["ids"].tolist())].reset_index(drop=True)
    rig = Rig(params.physics, params.gripper, params.attempt)
    place = {str(name): i for i, name in enumerate(labels["ids"])}
    rows = placed.to_dict("records")
    films: dict[str, list[Film]] = {"held": [], "failed": []}
    for position in spread(placed["class"], len(placed)):
        name, held = rows[position]["id"], len(films["held"]) <= len(films["failed"])
        resting = load_resting(data / "objects/train", data / "collision/train", rows[position])
        successes = labels["successes"][place[name]]
        rng = generator(params.seed, "report", "films", name)
        film = (
            film_best_grasp(name, resting, successes, rig) if held else film_failure(name, resting, successes, rig, rng)
        )
        if film:
            films["held" if held else "failed"].append(film)
        if min(map(len, films.values())) == SHOWN_FILMS:
            break
    return films


def _recorded(data: Path, trials: pd.DataFrame, params: Any) -> Recorded:
    """Successes of the robust method first, from different objects, with the least uncertainty first."""
    order = trials.assign(robust=trials["method"] != "Robust Best Grasp", failed=~trials["success"])
    order = order.sort_values(["failed", "robust", "sigma_uv_mm", "object", "placement", "network"])
    chosen = order[~order["failed"]].drop_duplicates("object").head(SHOWN_GRASPS)
    folder, arm = source_of(params.robot, params.arm, params.gripper)
    if params.robot.source == "simulated":
        folder = data / "recordings"
    table = read_tables(folder, [folder / file for file in trials["file"]])

    def read(file: str) -> TrialRecording:
        return read_trial(folder / file, params.topics, arm, table.get(folder / file))

    first = read(order["file"].iloc[0])
    camera = camera_of(first)
    grasps = []
    for line in chosen.to_dict("records"):
        trial = read(line["file"])
        assert trial.commanded is not None and trial.achieved is not None  # a success
        filled = fill_holes(trial.depth, None)  # a recording does not say how high its camera was
        grasps.append(ExecutedGrasp(line["object"], filled, trial.commanded, trial.achieved))
    return Recorded(camera, first.depth, fill_holes(first.depth, None), tuple(grasps))


def _histories(folder: Path, networks: dict[str, str]) -> dict[str, pd.DataFrame]:
    return {network: pd.read_csv(folder / run / "history.csv") for network, run in networks.items()}


def load_inputs(data: Path, params: Any, stage_seconds: Mapping[str, float]) -> ReportInputs:
    """Read the files under `data`; of images only the few rows that figures show. Films one simulated grasp."""
    labels = read_npz(data / "labels/train.npz")
    labelled = _labelled(data, labels, params)
    networks = {network: f"{network}-{params.training_seeds[0]}" for network in params.networks}  # the first start
    robot_trials = pd.read_parquet(data / "robot_trials.parquet")
    trials, test_account = pd.read_parquet(data / "trials.parquet"), pd.read_parquet(data / "labels/test.parquet")
    placed = {split: pd.read_parquet(data / "placed" / f"{split}.parquet") for split in SPLITS}
    return ReportInputs(
        data=data,
        params=params,
        parameters=flat_parameters(params),
        camera=Camera.from_params(params.camera),
        manifests={split: read_manifest(data / "objects" / split) for split in SPLITS},
        placed=placed,
        rejects=pd.read_parquet(data / "objects/rejects.parquet"),
        account=pd.read_parquet(data / "labels/train.parquet"),
        test_account=test_account,
        graspable=graspable_objects(test_account, params.label.attempts),
        widths_m=widths(data / "objects/test", placed["test"]),
        pretraining=_histories(data / "pretrained", networks),
        training=_histories(data / "networks", networks),
        trials=trials,
        plans=plans_of(trials),
        disturbed=pd.read_parquet(data / "robustness.parquet"),
        robot_trials=robot_trials,
        robot_uncertainty=pd.read_parquet(data / "robot_uncertainty.parquet"),
        robot_unused=pd.read_parquet(data / "robot_unused.parquet"),
        labelled=labelled,
        predicted=_predicted(data, networks, params),
        film=_film(data, labels, labelled.id, params),
        films=_films(data, labels, params),
        recorded=_recorded(data, robot_trials, params),
        failures=tuple(
            FailedTrial(file, page_path(data / FAILURES, file).read_bytes())
            for file in some(robot_trials, SHOWN_FAILURES)
        ),
        stage_seconds=stage_seconds,
    )
