"""Record trials of the simulated robot, one MCAP each; those of a folder are read where they lie (paper VII-B)."""

import hashlib
import importlib.metadata
import shutil
from pathlib import Path

import numpy as np

from graspfn.evaluation.planner import Planner
from graspfn.imaging.camera import Camera
from graspfn.imaging.renderers import renderer
from graspfn.learning.device import pick_device
from graspfn.learning.folder import input_kind
from graspfn.learning.weights import load_network
from graspfn.params import Declared
from graspfn.physics.world import Rig
from graspfn.robot.gantry import Gantry
from graspfn.robot.record import trial_bytes
from graspfn.robot.scenes import Scenes
from graspfn.robot.simulated import file_name, record
from graspfn.robot.trial import TrialRecording
from graspfn.workflow.files import atomic, keep_only
from graspfn.workflow.resume import Arrays, each_object
from graspfn.workflow.shards import code_digest, shard_key, shard_path
from graspfn.workflow.stage import stage

DATA, NETWORKS, OUT = Path("data"), Path("data/networks"), Path("data/recordings")
ROOMS = ("seeds.py", "geometry", "meshes", "physics", "imaging", "learning", "planning", "evaluation", "robot")


def scenes_of(params: Declared) -> Scenes:
    seed = params.training_seeds[0]
    folders = {name: NETWORKS / f"{name}-{seed}" for name in params.networks}
    networks = {name: (seed, input_kind(folder), load_network(folder)) for name, folder in folders.items()}
    cells = list(zip(params.robot.sigma_uv_mm, params.robot.sigma_theta_deg, strict=True))
    return Scenes(
        DATA,
        params.robot.objects,
        params.robot.placements,
        networks,
        cells,
        Planner(params.plan, params.seed),
        Camera.from_params(params.camera),
        params.table,
        params.noise,
        renderer(params.camera.renderer),
        Rig(params.physics, params.gripper, params.attempt),
        pick_device(params.compute.device),
    )


def made_by(params: Declared) -> dict[str, str]:
    """The version of this software and the hash of each network's weights, as every recording has them."""
    weights = {name: NETWORKS / f"{name}-{params.training_seeds[0]}/weights.safetensors" for name in params.networks}
    hashes = {f"{name}_sha256": hashlib.sha256(path.read_bytes()).hexdigest() for name, path in weights.items()}
    return {"graspfn": importlib.metadata.version("graspfn"), **hashes}


def simulate(params: Declared) -> None:
    scenes, robot, topics = scenes_of(params), params.robot, params.topics
    software = made_by(params)
    arm = Gantry(Camera.from_params(params.camera), params.gripper)
    common = shard_key(code_digest(*ROOMS), software, topics, robot.depth_encoding)
    shards = {key: shard_path("record_robot", shard_key(common, *scenes.depends(key))) for key in scenes.keys}

    def packed(parts: list[list[TrialRecording]]) -> Arrays:
        return {
            file_name(trial.condition): np.frombuffer(
                trial_bytes(trial, topics, robot.depth_encoding, arm, software), np.uint8
            )
            for trial in parts[0]
        }

    done, _ = each_object(
        "record_robot", shards, record, lambda key: [scenes.task(key)], packed, params.compute, robot.max_failed
    )
    for files in done.values():
        for name, content in files.items():
            with atomic(OUT / name) as part:
                part.write_bytes(content.tobytes())


@stage("record_robot")
def main(params: Declared) -> None:
    keep_only(NETWORKS, [f"{name}-{seed}" for name in params.networks for seed in params.training_seeds])
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    if params.robot.source == "simulated":
        simulate(params)


if __name__ == "__main__":
    main()
