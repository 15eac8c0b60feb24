"""Every figure of the report, with its caption, from the report's inputs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from graspfn.evaluation.planner import TRUE
from graspfn.geometry import grid
from graspfn.planning.methods import ROBUST, best_grasp, robust_best_grasp
from graspfn.planning.robust import RobustFunction
from graspfn.planning.smoothing import axis_weights
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.reporting.figures import (
    depth_images,
    expected,
    grasp_functions,
    label_outcomes,
    nearest,
    promise,
    robustness,
    simulated_grasps,
    success,
    training_curves,
)
from graspfn.reporting.figures import sizes as size_figures
from graspfn.reporting.figures.objects import contact_sheets
from graspfn.reporting.figures.style import Plate
from graspfn.reporting.inputs import PredictedExample, ReportInputs
from graspfn.reporting.plans import block_to_show
from graspfn.reporting.sizes import sizes
from graspfn.reporting.tables import who_recorded
from graspfn.seeds import generator

SUMMARY_SIGMA_MM = 20.0
PREDICTION_SIGMA = (15.0, 10.0)  # mm, degrees
GROWING_SIGMAS = ((2.0, 5.0), (5.0, 10.0), (10.0, 20.0), (20.0, 40.0))
FILMS = {"held": "Attempts that held,", "failed": "Attempts that touched the object and failed,"}


def by_success(table1: pd.DataFrame) -> list[str]:
    """Networks by the success of their Robust Best Grasp over all cells, best first."""
    block = block_to_show(dict.fromkeys(table1["objects_of"]))
    robust = table1[(table1["objects_of"] == block) & (table1["method"] == ROBUST) & (table1["network"] != TRUE)]
    mean = robust.groupby("network")["success"].mean()
    return [str(network) for network in mean.sort_values(ascending=False, kind="stable").index]


def slice_for_summary(f: np.ndarray, sigma_mm: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """u [mm], f and f smoothed along u (n,) of the slice of f (33, 44, 6) at which smoothing gains the most.

    The gain is the smoothed score of the robust pose over that of the best pose; a slice whose maximum is not unique
    says less, so it only serves where there is no other.
    """
    n_u = grid.SHAPE[1]
    at = np.linspace(0, n_u - 1, (n_u - 1) * 5 + 1)
    fine = np.moveaxis(f, 1, -1).reshape(-1, n_u) @ axis_weights(at, n_u, 0.0).T
    smooth = np.moveaxis(f, 1, -1).reshape(-1, n_u) @ axis_weights(at, n_u, sigma_mm / 1000 / grid.CELL_M).T
    gain = smooth.max(axis=1) - np.take_along_axis(smooth, fine.argmax(axis=1)[:, None], axis=1)[:, 0]
    unique = (fine >= fine.max(axis=1, keepdims=True) - 1e-9).sum(axis=1) == 1
    row = int(np.argmax(gain + unique))
    return (at - (n_u - 1) / 2) * grid.CELL_M * 1000, fine[row], smooth[row]


def _robust(
    inputs: ReportInputs, example: PredictedExample, network: str, sigma: tuple[float, float]
) -> np.ndarray | None:
    """Ties are drawn as the evaluation draws them."""
    rng = generator(inputs.params.seed, "plan", example.id, network)
    function = RobustFunction(example.planned_on[network], PoseUncertainty.of(*sigma))
    return robust_best_grasp(function, inputs.params.plan, rng)


def _functions(inputs: ReportInputs, network: str) -> Iterator[Plate]:
    labelled, camera, opening = inputs.labelled, inputs.camera, inputs.params.gripper.opening_mm
    u_mm, f, smoothed = slice_for_summary(labelled.f, SUMMARY_SIGMA_MM)
    yield Plate(
        "summary_1d",
        f"The idea in one dimension: a slice along u of the labelled grasp function of {labelled.id}, and the same "
        f"smoothed along u with σ = {SUMMARY_SIGMA_MM:g} mm. Best Grasp takes the maximum of the first, Robust Best "
        "Grasp that of the second. Of all slices, the one on which they differ most.",
        grasp_functions.draw_summary_1d(u_mm, f, smoothed, SUMMARY_SIGMA_MM),
    )
    yield Plate(
        "grasp_function",
        f"The labelled grasp function of {labelled.id}. Every line is a gripper pose, along the direction in which the "
        "jaws close; its thickness is the score, the share of attempts inside the pose's cell that held.",
        grasp_functions.draw_grasp_function(labelled.depth, labelled.f, camera),
    )
    yield Plate(
        "training_example",
        f"A training example ({labelled.id}): (a) noise-free depth image, (b) the same with noise, enlarged, (c) the "
        "labelled grasp function at all of Q, (d) at every third pose along u and v.",
        grasp_functions.draw_training_example(labelled.depth, labelled.noisy, labelled.f, camera),
    )
    depths = [example.depth for example in inputs.predicted]
    networks = list(inputs.predicted[0].functions)
    functions = {name: [example.functions[name] for example in inputs.predicted] for name in networks}
    poses = {
        name: [
            (
                best_grasp(example.planned_on[name], generator(inputs.params.seed, "plan", example.id, name)),
                _robust(inputs, example, name, PREDICTION_SIGMA),
            )
            for example in inputs.predicted
        ]
        for name in networks
    }
    names = ", ".join(example.id for example in inputs.predicted)
    yield Plate(
        "predictions",
        "What each network predicts for test objects it has never seen, from a noisy depth image (shown without the "
        "noise), with the pose of Best Grasp and that of Robust Best Grasp for "
        f"σuv = {PREDICTION_SIGMA[0]:g} mm, σθ = {PREDICTION_SIGMA[1]:g}°. "
        f"The first objects of different classes, not chosen by result: {names}.",
        grasp_functions.draw_predictions(depths, functions, poses, opening, camera),
    )
    growing = [[_robust(inputs, example, network, sigma) for sigma in GROWING_SIGMAS] for example in inputs.predicted]
    yield Plate(
        "growing_uncertainty",
        f"Growing uncertainty: the pose of Robust Best Grasp (red) on the grasp function predicted by {network}, for "
        "the objects of the previous figure.",
        grasp_functions.draw_growing_uncertainty(depths, growing, GROWING_SIGMAS, opening, camera),
    )


def _results(inputs: ReportInputs, table1: pd.DataFrame, disturbed: pd.DataFrame) -> Iterator[Plate]:
    plans = inputs.plans
    yield from success.plates(table1, plans, inputs.graspable, inputs.widths_m, by_success(table1))
    yield from promise.plates(table1, plans)
    yield from expected.plates(table1, plans)
    yield from robustness.plates(disturbed, by_success(table1))
    starts = inputs.params.training_seeds
    which = f" Of {len(starts)} training seeds the first." if len(starts) > 1 else ""
    yield Plate(
        "training_curves",
        f"Loss of every gradient step (faint) and its mean over the last twentieth of the run.{which}",
        training_curves.draw_training_curves(inputs.pretraining, inputs.training),
    )
    yield Plate(
        "label_outcomes",
        "How the attempts that label the training objects ended.",
        label_outcomes.draw_label_outcomes(inputs.account),
    )


def _images(inputs: ReportInputs) -> Iterator[Plate]:
    labelled, camera, params = inputs.labelled, inputs.camera, inputs.params
    yield Plate(
        "noise",
        f"The noise model: σp = {params.noise.sigma_p_px:g} px, σd = {params.noise.sigma_d_mm:g} mm, on the depth "
        f"image of {labelled.id}.",
        depth_images.draw_noise(labelled.depth, labelled.noisy, camera),
    )
    recorded, simulated = inputs.recorded, bool(inputs.robot_trials["simulated"].any())
    yield Plate(
        "inpainting",
        f"A recorded depth image before and after hole filling. {who_recorded(inputs.robot_trials)}",
        depth_images.draw_inpainting(recorded.raw, recorded.filled, recorded.camera, simulated),
    )
    if recorded.grasps:
        yield Plate(
            "example_grasps",
            "Successful trials, one per object: the commanded pose and the pose reached over the recorded depth image. "
            + who_recorded(inputs.robot_trials),
            depth_images.draw_example_grasps(recorded.grasps, params.gripper.opening_mm, recorded.camera, simulated),
        )


def _scenes(inputs: ReportInputs) -> Iterator[Plate]:
    if inputs.film:
        yield Plate(
            "simulated_grasp",
            f"A simulated grasp of {inputs.film.id}: the hand is kinematic, the fingers close under constant torque, "
            "the hand rises at constant speed. Lines on the table are 5 cm apart.",
            simulated_grasps.draw_simulated_grasp(simulated_grasps.film_scenes(inputs.film)),
        )
    for name, films in inputs.films.items():
        if films:
            yield Plate(
                f"films_{name}",
                f"{FILMS[name]} of different training objects, the first ones of different classes: hand in place, "
                "fingers closed, 5 cm up, at the top.",
                simulated_grasps.draw_films(films),
            )
    yield from size_figures.plates(sizes(inputs.manifests, inputs.placed), inputs.params.settle.fit)
    yield from contact_sheets(inputs.data)
    yield from nearest.plates(inputs.data, inputs.manifests, inputs.placed)


def draw_all(inputs: ReportInputs, table1: pd.DataFrame, disturbed: pd.DataFrame) -> Iterator[Plate]:
    """Every figure, one at a time; disturbed: the table of robustness."""
    yield from _functions(inputs, by_success(table1)[0])
    yield from _results(inputs, table1, disturbed)
    yield from _images(inputs)
    yield from _scenes(inputs)
