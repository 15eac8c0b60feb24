"""Plans on disturbed depth images of the test objects, with the table found and believed: robustness."""

from itertools import product
from pathlib import Path

from graspfn.evaluation.planner import Planner
from graspfn.evaluation.robustness import Conditions, disturb_case
from graspfn.evaluation.scenes import Scenes
from graspfn.imaging.camera import Camera
from graspfn.params import Declared, read_camera
from graspfn.physics.world import Rig
from graspfn.workflow.files import keep_only, write_parquet
from graspfn.workflow.resume import lines_of_each
from graspfn.workflow.shards import code_digest, shard_key, shard_path
from graspfn.workflow.stage import stage

DATA, CAMERAS, OUT = Path("data"), Path("conf/camera"), Path("data/robustness.parquet")
ROOMS = ("seeds.py", "geometry", "meshes", "physics", "imaging", "learning", "planning", "evaluation")


@stage("disturb")
def main(params: Declared) -> None:
    others = {}
    for name in params.disturb.cameras:
        camera, noise = read_camera(CAMERAS / f"{name}.yaml", params.noise)
        others[name] = (Camera.from_params(camera), noise)
    conditions = Conditions(
        rig=Rig(params.physics, params.gripper, params.attempt),
        planner=Planner(params.plan, params.seed),
        camera=Camera.from_params(params.camera),
        renderer=params.camera.renderer,
        table=params.table,
        noise=params.noise,
        others=others,
        disturb=params.disturb,
        seed=params.seed,
    )
    runs = list(product(params.networks, params.training_seeds))
    keep_only(DATA / "networks", [f"{network}-{seed}" for network, seed in runs])
    first = [(network, params.training_seeds[0]) for network in params.networks]  # what disturbs one, disturbs all
    scenes, code = Scenes(DATA, conditions, first), code_digest(*ROOMS)
    shards = {name: shard_path("disturb", shard_key(code, *scenes.depends(name))) for name in scenes.names}
    plans = lines_of_each("disturb", shards, disturb_case, scenes.task, params.compute, params.disturb.max_failed)
    write_parquet(OUT, plans)
    print(plans.groupby(["table_fit", "method", "network"])["stays"].mean().to_string())


if __name__ == "__main__":
    main()
