"""Record robot trials, one MCAP each: executed by the simulated robot, or taken over from a folder (paper V-B)."""

import shutil
from collections.abc import Hashable, Iterator
from pathlib import Path
from typing import Any

from graspfn.evaluation.trials import Sigma, plan_all
from graspfn.geometry.camera import Intrinsics
from graspfn.geometry.transforms import T_world_scene
from graspfn.imaging.holes import fill_holes
from graspfn.imaging.network_input import network_input
from graspfn.imaging.placement import random_placement
from graspfn.imaging.render import renderer
from graspfn.learning.device import pick_device
from graspfn.learning.prediction import predict
from graspfn.learning.weights import load_network
from graspfn.meshes.placed import load_resting, resting_rows
from graspfn.meshes.store import read_manifest
from graspfn.params import Declared
from graspfn.physics.world import Rig
from graspfn.robot.read import read_trial, recordings
from graspfn.robot.record import write_trial
from graspfn.robot.simulated import Scene, file_name, record, see
from graspfn.workflow.files import keep_only
from graspfn.workflow.parallel import map_objects
from graspfn.workflow.seeds import generator
from graspfn.workflow.stage import stage

MESHES, PLACED = Path("data/objects/test"), Path("data/placed/test.parquet")
COLLISION, NETWORKS, OUT = Path("data/collision/test"), Path("data/networks"), Path("data/recordings")


def robot_objects(params: Declared) -> list[dict[Hashable, Any]]:
    """Lines of placed objects: the first that rest in the order of selection, which takes classes in turn."""
    order = read_manifest(MESHES).sort_values("seed_index")["id"].tolist()
    placed = resting_rows(PLACED)
    return [placed[name] for name in order if name in placed][: params.robot.objects]


def simulated_tasks(objects: list[dict[Hashable, Any]], params: Declared) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Every scene with the plans of all methods under all conditions."""
    camera, render = Intrinsics.from_params(params.camera), renderer(params.camera.renderer)
    device = pick_device(params.compute.device)
    networks = {name: load_network(NETWORKS / name) for name in params.networks}
    sigmas = [Sigma(*pair) for pair in zip(params.robot.sigma_uv_mm, params.robot.sigma_theta_deg, strict=True)]
    rig = Rig(params.physics, params.gripper, params.attempt)
    for row in objects:
        name, resting = row["id"], load_resting(MESHES, COLLISION, row)
        mesh, T = resting.mesh, resting.T_world_object
        centred = render(mesh, T, camera)
        for placement in range(params.robot.placements):
            rng = generator(params.seed, "record_robot", name, placement)
            shift, theta = random_placement(centred, camera, rng)
            depth = see(render(mesh, T_world_scene(shift, theta) @ T, camera), params.noise, camera, rng)
            filled = fill_holes(depth, camera)
            functions = {
                key: predict(net, network_input(filled, camera)[None], device)[0] for key, net in networks.items()
            }
            scene = Scene(name, placement, shift, theta, depth)
            key = f"{name}-{placement}"
            plans = plan_all(filled, functions, sigmas, params.plan, camera, params.seed, key)
            yield key, (scene, plans, resting, rig, camera, params.seed)


@stage("record_robot")
def main(params: Declared) -> None:
    keep_only(NETWORKS, params.networks)
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    if params.robot.source == "folder":
        for path in recordings(Path(params.robot.folder)):
            read_trial(path, params.topics)  # refuses, before anything runs on it, what cannot be analysed
            shutil.copyfile(path, OUT / path.name)
        return
    objects = robot_objects(params)
    scenes = len(objects) * params.robot.placements
    for name, result in map_objects(record, simulated_tasks(objects, params), scenes, params.compute, "record"):
        if isinstance(result, Exception):
            print(f"left out {name}: {result}")
            continue
        for trial in result:
            write_trial(OUT / file_name(trial.condition), trial, params.topics, params.robot.depth_encoding)


if __name__ == "__main__":
    main()
