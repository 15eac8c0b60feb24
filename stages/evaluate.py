"""Simulated trials of every method at every uncertainty of Table 1 (paper VII-A)."""

from itertools import product
from pathlib import Path

from graspfn.evaluation.cases import Cases, Protocol, try_object
from graspfn.evaluation.planner import Planner
from graspfn.imaging.camera import Camera
from graspfn.params import Declared
from graspfn.physics.world import Rig
from graspfn.workflow.files import keep_only, write_parquet
from graspfn.workflow.resume import lines_of_each
from graspfn.workflow.shards import code_digest, shard_key, shard_path
from graspfn.workflow.stage import stage

DATA, FUNCTIONS, OUT = Path("data"), Path("data/functions"), Path("data/trials.parquet")
ROOMS = ("seeds.py", "geometry", "meshes", "physics", "imaging", "planning", "evaluation")
ORDER = ["id", "sigma_theta_deg", "sigma_uv_mm", "method", "network", "training_seed", "error"]


@stage("evaluate")
def main(params: Declared) -> None:
    rig, camera = Rig(params.physics, params.gripper, params.attempt), Camera.from_params(params.camera)
    cells = tuple((uv, theta) for theta, uv in product(params.evaluate.sigma_theta_deg, params.evaluate.sigma_uv_mm))
    planner, errors = Planner(params.plan, params.seed), params.evaluate.errors_per_object
    protocol = Protocol(rig, planner, camera, params.table, params.noise, cells, errors, params.seed)
    runs = list(product(params.networks, params.training_seeds))
    keep_only(FUNCTIONS, [f"{network}-{seed}.npz" for network, seed in runs])
    cases = Cases(DATA, protocol, runs)
    code = code_digest(*ROOMS)
    shards = {name: shard_path("evaluate", shard_key(code, *cases.depends(name))) for name in cases.names}
    trials = lines_of_each("evaluate", shards, try_object, cases.task, params.compute, params.evaluate.max_failed)
    trials = trials.sort_values(ORDER, ignore_index=True)
    write_parquet(OUT, trials)
    print(trials.groupby(["method", "network"])["success"].mean().to_string())


if __name__ == "__main__":
    main()
