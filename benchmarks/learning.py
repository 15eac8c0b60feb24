"""How much a network learns: from how many objects, in how many steps, pre-trained or not (docs/learning.md).

    python benchmarks/learning.py --objects 32 100 320 983 --seeds 0 1 2
    python benchmarks/learning.py --pretrain 600 --set width=16
    python benchmarks/learning.py --judge data/networks/fcn-0 --views

In a folder where stage augment ran and test objects are labelled. Trains on the first so many objects of one shuffled
order, one core a run, then judges what is predicted of the graspable test objects, by their labels. Runs are kept in
.scratch/learning and trained once, so that several commands may share the work; each prints the lines of its runs.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from objects import committed
from torch.nn import functional

from graspfn.compose import compose
from graspfn.evaluation.expected import Attempts, expected_under
from graspfn.evaluation.objects import PlacedObjects, Placement
from graspfn.geometry import grid
from graspfn.geometry.transforms import move_pose, unmove_pose
from graspfn.imaging.camera import Camera
from graspfn.imaging.noise import observe
from graspfn.imaging.sight import Sight, look
from graspfn.imaging.warp import sample_function
from graspfn.learning.dataset import Samples, inputs_of
from graspfn.learning.folder import input_kind
from graspfn.learning.networks import build_network
from graspfn.learning.prediction import expected_scores, predict
from graspfn.learning.pretraining import class_indices, pretrain
from graspfn.learning.targets import CLASSES, ClassTargets, GraspTargets
from graspfn.learning.training import Descent, fit, grasp_loss, resources
from graspfn.learning.weights import load_network, save_network
from graspfn.meshes.store import read_manifest
from graspfn.params import Network, Params, Pretrain, validate
from graspfn.physics.labelling import held
from graspfn.planning.centroid import centroid_grasp, object_mask
from graspfn.planning.methods import best_grasp, robust_best_grasp
from graspfn.planning.objects import where_met
from graspfn.planning.robust import RobustFunction
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.seeds import generator
from graspfn.workflow.files import read_npz

DATA, KEPT = Path("data"), Path(".scratch/learning")
CELLS = ((5, 10), (10, 20), (20, 10), (20, 40))  # mm, degrees
BATCH = 16
SURE = 0.8  # score whose average precision is asked for
SPOKEN_FOR = 0.05  # predicted scores from which on calibration counts: nearly all others are 0 and right
BINS = 10
LONG = 2.0  # length over width of objects whose angle is judged


def binomial_loss(logits: torch.Tensor, scores: torch.Tensor) -> torch.Tensor:
    """Of the attempts that held, given the expected score; arguments as of `grasp_loss`."""
    rate, _ = expected_scores(logits)
    share = (scores / (CLASSES - 1)).clamp(0, 1)  # interpolation rounds
    return functional.binary_cross_entropy(rate.clamp(1e-6, 1 - 1e-6), share)


def attempts_loss(logits: torch.Tensor, counts: torch.Tensor) -> torch.Tensor:
    """Of every attempt as it ended; counts (B, 2, 33, 44, 6) float32: held and made in each cell."""
    rate, _ = expected_scores(logits)
    rate = rate.clamp(1e-6, 1 - 1e-6)
    held, made = counts.unbind(dim=1)
    return -(held * rate.log() + (made - held) * (1 - rate).log()).sum() / made.sum()


LOSSES = {"classes": grasp_loss, "binomial": binomial_loss, "attempts": attempts_loss}


class AttemptTargets:
    """Attempts held and made in each cell of Q, (B, 2, 33, 44, 6) float32, after the motion of each line of a table.

    Every attempt moves with its object and counts in the cell that it comes to: nothing is interpolated, so that no
    label is blurred. Where nothing was attempted, beyond Q as the object was labelled, nothing is held.
    held: (N, 33, 44, 6, n) bool; seeds: (N,), from which the attempts' poses follow.
    """

    def __init__(self, held: np.ndarray, seeds: np.ndarray, table: pd.DataFrame):
        self.held, self.seeds, self.table = held, seeds, table

    def batch(self, indices: list[int]) -> torch.Tensor:
        return torch.from_numpy(np.stack([self.counts(index) for index in indices]))

    def counts(self, index: int) -> np.ndarray:
        line = self.table.iloc[index]
        row, shift, theta = int(line["row"]), np.array([line["shift_u_m"], line["shift_v_m"]]), line["theta_rad"]
        kept = self.held[row] & (not line["empty"])
        n = kept.shape[-1]
        q = move_pose(grid.sample_cells(n, np.random.default_rng(self.seeds[row])), shift, theta)
        if line["mirrored"]:
            q = q * [1, -1, -1]
        at, inside = cells_of(q)
        flat = np.ravel_multi_index(tuple(at[inside].T), grid.SHAPE)
        total = int(np.prod(grid.SHAPE))
        counts = [np.bincount(flat, weights, total) for weights in (kept[inside].astype(float), None)]
        poses = grid.poses() * ([1, -1, -1] if line["mirrored"] else [1, 1, 1])
        _, attempted = cells_of(unmove_pose(poses, shift, theta))
        counts[1] = np.maximum(counts[1], n * ~attempted.ravel())
        return np.stack(counts).reshape(2, *grid.SHAPE).astype(np.float32)

    def source(self) -> np.ndarray:
        return np.packbits(self.held)


def cells_of(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Index (..., 3) int of the cell of Q that poses (..., 3) lie in, and whether there is one."""
    at = np.rint(grid.to_index(q)).astype(int)
    at[..., 2] %= grid.SHAPE[2]
    return at, ((at >= 0) & (at < grid.SHAPE)).all(axis=-1)


@dataclasses.dataclass(frozen=True, eq=False)
class Tested:
    """A test object: as it is seen, where it stands, and what was attempted on it."""

    source: str
    sight: Sight
    placement: Placement
    attempts: Attempts

    def success(self, q: np.ndarray | None, cell: tuple[float, float]) -> float:
        """To expect of a pose (3,) of the image; 0 of None."""
        placed = self.placement
        return success(None if q is None else unmove_pose(q, placed.shift_uv, placed.theta), cell, self.attempts)


def success(q: np.ndarray | None, cell: tuple[float, float], attempts: Attempts) -> float:
    """To expect of a pose (3,) about the object as it was labelled; 0 of None."""
    if q is None:
        return 0.0
    with warnings.catch_warnings():  # of its standard error, where there is one attempt a cell
        warnings.simplefilter("ignore", RuntimeWarning)
        return expected_under(q, PoseUncertainty.of(*cell), attempts).value


def graspable(params: Params, kind: str) -> Iterator[Tested]:
    """The labelled test objects with a pose at which every attempt held, as networks with this input see them."""
    objects, images = PlacedObjects(DATA), np.load(DATA / "images/test.npy", mmap_mode="r")
    camera, source = Camera.from_params(params.camera), sources("test")
    for name in objects.names:
        attempts = objects.attempts(name)
        if attempts is None or not attempts.held.all(axis=-1).any():
            continue
        placement = objects.placement(name)
        image = observe(images[placement.row], params.noise, params.seed, name)
        yield Tested(source[name], look(image, camera, kind, params.table), placement, attempts)


def sources(split: str) -> dict[str, str]:
    """Where each object comes from."""
    manifest = read_manifest(DATA / "objects" / split)
    return dict(zip(manifest["id"], manifest["source"], strict=True))


def successes(tested: Sequence[Tested], functions: Sequence[np.ndarray], params: Params) -> dict[str, float]:
    """What to expect of each method, the mean over CELLS; of Robust Best Grasp by source as well."""
    found: dict[str, list[float]] = {"centroid": [], "best": [], "robust": []}
    for one, f in zip(tested, functions, strict=True):
        best, centroid = best_grasp(f, np.random.default_rng(0)), centroid_grasp(one.sight.seen)
        for cell in CELLS:
            robust = robust_best_grasp(RobustFunction(f, PoseUncertainty.of(*cell)), params.plan)
            for method, q in (("centroid", centroid), ("best", best), ("robust", robust)):
                found[method].append(one.success(q, cell))
    means = {method: float(np.mean(values)) for method, values in found.items()}
    per_object = pd.DataFrame(np.reshape(found["robust"], (len(tested), len(CELLS))).mean(axis=1), columns=["robust"])
    by_source = per_object.groupby([one.source for one in tested])["robust"].mean()
    return means | {f"robust {source}": float(value) for source, value in by_source.items()}


def average_precision(scores: np.ndarray, positive: np.ndarray) -> float:
    """Area under precision over recall, (N,) each; the scores' order is all that counts."""
    ranked = positive[np.argsort(-scores, kind="stable")]
    precision = np.cumsum(ranked) / np.arange(1, len(ranked) + 1)
    return float(precision[ranked].mean())


def of_function(tested: Sequence[Tested], functions: Sequence[np.ndarray]) -> dict[str, float]:
    """The function's own numbers, pose by pose of the labels."""
    predicted, true, chosen, turned = [], [], [], []
    for one, f in zip(tested, functions, strict=True):
        where = one.placement.shift_uv, one.placement.theta
        rates = one.attempts.held.mean(axis=-1)
        predicted.append(sample_function(f, move_pose(grid.poses(), *where)).ravel())
        true.append(rates.ravel())
        best, centroid = best_grasp(f, np.random.default_rng(0)), centroid_grasp(one.sight.seen)
        chosen.append(0.0 if best is None else sample_function(rates, unmove_pose(best, *where)).item())
        if best is not None and centroid is not None and elongation(object_mask(one.sight.seen)) >= LONG:
            turned.append(abs(float(grid.angle_difference(best[2], centroid[2]))))
    scores, rates = np.concatenate(predicted), np.concatenate(true)
    spoken = scores >= SPOKEN_FOR
    bins = np.minimum((scores[spoken] * BINS).astype(int), BINS - 1)
    gaps = pd.DataFrame({"bin": bins, "gap": scores[spoken] - rates[spoken]}).groupby("bin")["gap"]
    return {
        "average_precision": average_precision(scores, rates >= SURE),
        "score_at_best": float(np.mean(chosen)),
        "calibration_error": float((gaps.mean().abs() * gaps.size()).sum() / spoken.sum()),
        "turned_deg": float(np.degrees(np.mean(turned))) if turned else float("nan"),
    }


def elongation(mask: np.ndarray) -> float:
    """Length over width of what (132, 176) bool shows, as of a rectangle with its spreads."""
    spreads = np.linalg.eigvalsh(np.cov(np.argwhere(mask), rowvar=False))
    return float(np.sqrt(spreads[1] / max(spreads[0], 1e-9)))


def seen_by(folder: Path, inputs: np.ndarray, views: bool) -> np.ndarray:
    """(M, 33, 44, 6) of a network; views: the mean of what it says of an image and of its three reflections."""
    network = load_network(folder)
    if not views:
        return predict(network, inputs)
    back = (-np.arange(grid.SHAPE[2])) % grid.SHAPE[2]
    total = np.zeros((len(inputs), *grid.SHAPE), np.float32)
    flips: tuple[tuple[int, ...], ...] = ((), (-2,), (-1,), (-2, -1))  # of the image's axes
    for flipped in flips:
        f = predict(network, np.flip(inputs, flipped))
        f = np.flip(f, tuple(axis - 1 for axis in flipped))
        total += f[..., back] if len(flipped) == 1 else f
    return total / 4


def judge(folders: Sequence[Path], params: Params, views: bool) -> dict[str, float]:
    """All numbers of a network, or of the mean of the functions of several."""
    kinds = {input_kind(folder) for folder in folders}
    assert len(kinds) == 1, "networks judged together see the same"
    tested = list(graspable(params, kinds.pop()))
    inputs = np.stack([one.sight.inputs for one in tested])
    scores = np.mean([seen_by(folder, inputs, views) for folder in folders], axis=0)
    functions = [where_met(f, one.sight.seen, params.gripper) for f, one in zip(scores, tested, strict=True)]
    return {"tested": len(tested)} | successes(tested, functions, params) | of_function(tested, functions)


def learnt(settings: dict[str, Any], network: Network, params: Params) -> Path:
    """The folder of a network trained as `settings` say."""
    folder = KEPT / ",".join(f"{key}={value}" for key, value in settings.items())
    if (folder / "weights.safetensors").exists():
        return folder
    labels, table = read_npz(DATA / "labels/train.npz"), pd.read_parquet(DATA / "augmentation.parquet")
    index = pd.read_parquet(DATA / "images/train.parquet")
    place = {name: i for i, name in enumerate(labels["ids"].tolist())}
    source, wanted = sources("train"), settings.get("source")
    rows = [row for row, name in enumerate(index["id"]) if name in place and wanted in (None, source[name])]
    rows = sorted(generator(0, "learning").permutation(rows)[: settings["objects"]].tolist())
    table = table[table["row"].isin(rows)].reset_index(drop=True)
    table["mirrored"] &= not settings["plain"]
    noise = validate(compose([f"noise={settings['noise']}"])).noise if "noise" in settings else params.noise
    inputs = inputs_of(network.input, DATA / "images", table, Camera.from_params(params.camera), noise)
    seed, run = settings["seed"], folder.name
    model = build_network(network, seed)
    if settings["pretrain"]:
        classes, names = class_indices(index["class"].tolist())
        samples = Samples(table, inputs, ClassTargets(classes, table))
        length = Pretrain(settings["pretrain"] * BATCH / len(table), BATCH)
        scratch = resources(params.compute, f"learning-pretrain-{run}")
        pretrain(model, samples, names, length, network, seed, scratch)
    successes = np.stack([labels["successes"][place[index["id"][row]]] for row in rows])
    numbered = table.assign(row=np.searchsorted(rows, table["row"]))
    targets = GraspTargets(successes, int(labels["attempts"]), numbered)
    model.set_prior(targets.class_frequencies())
    if settings["loss"] == "attempts":
        own = [place[index["id"][row]] for row in rows]
        targets = AttemptTargets(held(labels["outcomes"][own]), labels["seeds"][own], numbered)  # type: ignore[assignment]
    samples = Samples(table, inputs, targets)
    epochs = settings["steps"] * BATCH / len(table)
    descent = Descent("train", seed, epochs, BATCH, network.learning_rate, network.weight_decay)
    fit(model, LOSSES[settings["loss"]], samples, descent, resources(params.compute, f"learning-{run}"))
    save_network(folder, model, network)
    return folder


def changed(network: Network, settings: Mapping[str, str]) -> Network:
    """With these values put in."""
    return dataclasses.replace(network, **{key: type(getattr(network, key))(text) for key, text in settings.items()})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--network", default="fcn", help="of params.yaml")
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", help="of the network's parameters")
    parser.add_argument("--objects", type=int, nargs="+", default=[1_000_000])
    parser.add_argument("--source", help="train on objects of this source alone")
    parser.add_argument("--steps", type=int, nargs="+", default=[2000])
    parser.add_argument("--pretrain", type=int, default=0, help="steps of pre-training")
    parser.add_argument("--loss", choices=LOSSES, default="classes")
    parser.add_argument("--noise", help="of training, a choice of conf/noise")
    parser.add_argument("--plain", action="store_true", help="no sample is seen in a mirror")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--views", action="store_true", help="predict as the mean over an image's reflections")
    parser.add_argument("--judge", type=Path, nargs="+", default=[], help="networks to judge, the mean of several")
    arguments = parser.parse_args()
    params = committed()
    if arguments.judge:
        print(json.dumps(judge(arguments.judge, params, arguments.views)))
        return
    params = dataclasses.replace(params, compute=dataclasses.replace(params.compute, loaders=0))
    changes = dict(one.split("=") for one in arguments.set)
    network = changed(params.network[arguments.network], changes)
    for objects, steps, seed in itertools.product(arguments.objects, arguments.steps, arguments.seeds):
        settings = {"network": arguments.network, **changes}
        settings |= {"objects": objects, "steps": steps, "pretrain": arguments.pretrain, "seed": seed}
        settings |= {"loss": arguments.loss, "plain": arguments.plain}
        settings |= {key: value for key in ("source", "noise") if (value := getattr(arguments, key))}
        folder = learnt(settings, network, params)
        line = settings | {"views": arguments.views} | judge([folder], params, arguments.views)
        print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
