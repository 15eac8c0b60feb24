"""How fast training samples are made, beside a step of the network that they feed.

    python benchmarks/feeding.py --batches 20

Objects are the generated ones of the parameters, labelled at random: neither their shapes nor their labels change what
a sample costs. Both inputs in turn, batch after batch, so that what else the machine does falls on both alike.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch
import trimesh
from objects import committed

from graspfn.geometry.grid import SHAPE
from graspfn.geometry.transforms import translation
from graspfn.imaging.camera import Camera
from graspfn.imaging.orthographic import render_heights
from graspfn.imaging.render import render_depth
from graspfn.learning.augmentation import augmentation_table
from graspfn.learning.dataset import Samples
from graspfn.learning.depth_inputs import DepthInputs
from graspfn.learning.device import pick_device
from graspfn.learning.height_inputs import HeightInputs
from graspfn.learning.networks import build_network
from graspfn.learning.sensor import View
from graspfn.learning.targets import GraspTargets
from graspfn.learning.training import BLOCK, grasp_loss

INPUTS = ("depth", "height_map")


def seconds(work: Callable[[], object], device: torch.device) -> float:
    """Of one call, until the device has done what it started."""
    started = time.perf_counter()
    work()
    if device.type == "cuda":
        torch.cuda.synchronize()
    return time.perf_counter() - started


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--batches", type=int, default=10)
    parser.add_argument("--network", default="fcn")
    parser.add_argument("--device", default="cpu")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    params, device = committed(), pick_device(arguments.device)
    camera, batch = Camera.from_params(params.camera), params.train.batch_size
    meshes = [trimesh.creation.box((0.12, 0.05, 0.06)), trimesh.creation.icosphere(4, 0.04)]
    resting = [translation(0, 0, -mesh.bounds[0, 2]) for mesh in meshes]
    images = np.stack([render_depth(mesh, T, camera) for mesh, T in zip(meshes, resting, strict=True)])
    maps = np.stack([render_heights(mesh, T) for mesh, T in zip(meshes, resting, strict=True)])
    table = augmentation_table(maps, ["box", "ball"], replace(params.augment, samples=512), params.seed)
    successes = np.random.default_rng(0).integers(0, 6, (2, *SHAPE)).astype(np.uint8)
    makers: dict[str, DepthInputs | HeightInputs] = {
        "depth": DepthInputs(images, table, camera, params.noise),
        "height_map": HeightInputs(maps, table, View.of(camera), params.noise),
    }
    networks = {kind: build_network(replace(params.network[arguments.network], input=kind)) for kind in INPUTS}
    spent: dict[tuple[str, str], list[float]] = {(kind, what): [] for kind in INPUTS for what in ("samples", "step")}
    for kind in INPUTS * (1 + arguments.batches):  # the first time warms up
        samples = Samples(table, makers[kind], GraspTargets(successes, 5, table))
        many = BLOCK if device.type != "cpu" and samples.to(device) else batch
        places = np.random.default_rng(len(spent[kind, "samples"])).integers(len(table), size=many).tolist()
        made = samples.__getitems__(places)
        spent[kind, "samples"].append(seconds(lambda: samples.__getitems__(places), device) / many)  # noqa: B023
        network = networks[kind].to(device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        x, y = (part[:batch].to(device) for part in made)
        x = x.contiguous(memory_format=torch.channels_last)
        spent[kind, "step"].append(seconds(lambda: grasp_loss(network(x), y).backward(), device) / batch)  # noqa: B023
    median = {key: float(np.median(times[1:])) for key, times in spent.items()}
    for kind in INPUTS:
        made_s, step_s = median[kind, "samples"], median[kind, "step"]
        print(
            f"{kind:10} {1 / made_s:7.0f} samples/s made ({1e3 * made_s:.2f} ms each), {1 / step_s:7.0f} learnt from "
            f"({1e3 * step_s:.2f} ms): {min(1, step_s / made_s):.0%} of the time in the network with one loader beside "
            f"it, {step_s / (made_s + step_s):.0%} without"
        )
    print(f"height_map makes {median['depth', 'samples'] / median['height_map', 'samples']:.2f} times as many as depth")


if __name__ == "__main__":
    main()
