"""Simulated trials of every method at every uncertainty of Table 1 (paper V-A)."""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from graspfn.evaluation.trials import Bench, Sigma, trials_of_object
from graspfn.geometry.camera import Intrinsics
from graspfn.imaging.holes import fill_holes
from graspfn.imaging.noise import observe
from graspfn.meshes.placed import Resting, load_resting, resting_rows
from graspfn.params import Declared, Plan
from graspfn.physics.world import Rig
from graspfn.workflow.files import keep_only, read_npz, write_parquet
from graspfn.workflow.parallel import map_objects
from graspfn.workflow.stage import stage

MESHES, PLACED, IMAGES = Path("data/objects/test"), Path("data/placed/test.parquet"), Path("data/images")
COLLISION, FUNCTIONS, OUT = Path("data/collision/test"), Path("data/functions"), Path("data/trials.parquet")
MAX_FAILED = 0.1


class EvaluationError(ValueError):
    """Too many objects could not be tried."""


def evaluate_object(
    name: str,
    resting: Resting,
    rig: Rig,
    scene: tuple[np.ndarray, np.ndarray, float],
    functions: dict[str, np.ndarray],
    sigmas: list[Sigma],
    plan: Plan,
    camera: Intrinsics,
    seed: int,
) -> list[dict[str, Any]]:
    return trials_of_object(name, Bench(resting, rig), *scene, functions, sigmas, plan, camera, seed)


@stage("evaluate")
def main(params: Declared) -> None:
    camera = Intrinsics.from_params(params.camera)
    sigmas = [Sigma(uv, theta) for theta, uv in product(params.evaluate.sigma_theta_deg, params.evaluate.sigma_uv_mm)]
    rig = Rig(params.physics, params.gripper, params.attempt)
    images = np.load(IMAGES / "test.npy", mmap_mode="r")
    index = pd.read_parquet(IMAGES / "test.parquet").set_index("id")
    placed = resting_rows(PLACED)
    keep_only(FUNCTIONS, [f"{network}.npz" for network in params.networks])
    functions = {network: read_npz(FUNCTIONS / f"{network}.npz")["scores"] for network in params.networks}

    def arguments(name: str) -> tuple[Any, ...]:
        line = index.loc[name].to_dict()
        depth = fill_holes(observe(images[line["row"]], params.noise, params.seed, name), camera)
        scene = (depth, np.array([line["shift_u_m"], line["shift_v_m"]]), float(line["theta_rad"]))
        own = {network: scores[line["row"]] for network, scores in functions.items()}
        resting = load_resting(MESHES, COLLISION, placed[name])
        return name, resting, rig, scene, own, sigmas, params.plan, camera, params.seed

    tasks = ((name, arguments(name)) for name in index.index)
    rows, failed = [], 0
    for name, result in map_objects(evaluate_object, tasks, len(index), params.compute, "evaluate"):
        if isinstance(result, Exception):
            print(f"left out {name}: {result}")
            failed += 1
            continue
        rows += result
    if failed > MAX_FAILED * len(index):
        raise EvaluationError(f"{failed} of {len(index)} objects failed: Table 1 would mean nothing")
    keys = ["id", "sigma_theta_deg", "sigma_uv_mm", "method", "network"]
    trials = pd.DataFrame(rows).sort_values(keys, ignore_index=True)
    write_parquet(OUT, trials)
    print(trials.groupby(["method", "network"])["success"].mean().to_string())


if __name__ == "__main__":
    main()
