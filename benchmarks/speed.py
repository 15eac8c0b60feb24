"""From a depth image to a pose: milliseconds, beside GG-CNN2's published network and post-processing.

    python benchmarks/speed.py --repeats 100 --threads 2

GG-CNN2 as Morrison, Corke and Leitner describe it ("Learning robust, real-time, reactive robotic grasping", 2020): the
same image cropped, resized to 300 x 300 and its holes painted in, 67 thousand weights of chance (time does not depend
on them), quality and angle filtered, the best local maximum. It finds no table, no pose in metres, and knows no Sigma.

Paired: every repeat plans on an image with both, one after the other, so that whatever else the machine does meets
both; the ratio is the median of the pairs' ratios. Then what our own parts take, with ever wider Sigma.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
import trimesh
from scipy import ndimage

from graspfn.geometry.transforms import T_world_scene, translation
from graspfn.imaging.camera import Camera, straight_down
from graspfn.imaging.disturbances import turned
from graspfn.imaging.height_map import height_map
from graspfn.imaging.noise import add_noise
from graspfn.imaging.render import render_depth
from graspfn.imaging.sight import look
from graspfn.imaging.table import fit_table
from graspfn.params import Noise
from graspfn.planning.centroid import object_mask
from graspfn.planning.model import DEFAULT
from graspfn.planning.objects import meets, refusal
from graspfn.planning.planner import Grasp, GraspPlanner
from graspfn.planning.robust import RobustFunction
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.seeds import generator

SIDE = 300  # of GG-CNN2's input, px
# Of its layers: kernel, filters, dilation; "pool" halves, "up" doubles by transposed convolution.
LAYERS: tuple[tuple[Any, ...], ...] = (
    *(("conv", 11, 16, 1), ("conv", 5, 16, 1), ("pool",)),
    *(("conv", 5, 16, 1), ("conv", 5, 16, 1), ("pool",)),
    *(("conv", 5, 32, 2), ("conv", 5, 32, 4)),
    *(("up", 3, 16), ("up", 3, 16), ("conv", 1, 4, 1)),
)
HOLES = Noise(sigma_p_px=1, sigma_d_mm=1.5)
SIGMAS = ((2.0, 3.0), (5.0, 10.0), (20.0, 40.0), (60.0, 90.0))  # mm, degrees


def ggcnn2() -> torch.nn.Module:
    """(1, 1, 300, 300) -> (1, 4, 300, 300): quality, cosine and sine of twice the angle, width."""
    layers: list[torch.nn.Module] = []
    channels = 1
    for kind, *sizes in LAYERS:
        if kind == "pool":
            layers.append(torch.nn.MaxPool2d(2))
            continue
        kernel, filters = sizes[:2]
        if kind == "up":
            layers.append(torch.nn.ConvTranspose2d(channels, filters, kernel, stride=2, padding=1, output_padding=1))
        else:
            dilation = sizes[2]
            layers.append(torch.nn.Conv2d(channels, filters, kernel, padding=kernel // 2 * dilation, dilation=dilation))
        layers.append(torch.nn.ReLU())
        channels = filters
    return torch.nn.Sequential(*layers[:-1]).eval()  # the last is linear


def plan_as_ggcnn2(network: torch.nn.Module, depth: np.ndarray) -> tuple[int, int, float]:
    """Row, column and angle in the network's input."""
    height, width = depth.shape
    top, left = (height - min(depth.shape)) // 2, (width - min(depth.shape)) // 2
    square = depth[top : top + min(depth.shape), left : left + min(depth.shape)]
    seen = np.nan_to_num(square)
    holes = (seen == 0).astype(np.uint8)
    scale = float(seen.max())
    painted = cv2.inpaint((seen / scale).astype(np.float32), holes, 1, cv2.INPAINT_NS) * scale
    image = cv2.resize(painted, (SIDE, SIDE), interpolation=cv2.INTER_AREA)
    image = np.clip(image - image.mean(), -1, 1)
    with torch.inference_mode():
        quality, cosine, sine, width_px = network(torch.from_numpy(image)[None, None]).numpy()[0]
    quality = ndimage.gaussian_filter(quality, 2.0)
    angle = ndimage.gaussian_filter(np.arctan2(sine, cosine) / 2, 2.0)
    ndimage.gaussian_filter(width_px, 1.0)
    peaks = np.where(ndimage.maximum_filter(quality, 41) == quality, quality, -np.inf)
    row, column = np.unravel_index(int(peaks.argmax()), peaks.shape)
    return int(row), int(column), float(angle[row, column])


def scenes(count: int) -> tuple[Camera, list[np.ndarray]]:
    """Images (480, 640) of an object anywhere, by a camera that is tilted by 12 degrees."""
    bar = trimesh.creation.box((0.12, 0.03, 0.02), translation(0, 0, 0.01))
    post = trimesh.creation.box((0.03, 0.03, 0.07), translation(0.045, 0, 0.035))
    mesh = trimesh.boolean.union([bar, post])
    camera = turned(Camera(640, 480, (570.0, 570.0, 319.5, 239.5), (), straight_down(0.45)), np.radians(12), 0.7)
    images = []
    for i in range(count):
        rng = generator(0, "speed", i)
        T = T_world_scene(rng.uniform(-0.07, 0.07, 2), 2 * np.pi * rng.random())
        image = add_noise(render_depth(mesh, T, camera), HOLES, rng)
        images.append(np.where(rng.random(image.shape) < 0.02, np.float32(np.nan), image).astype(np.float32))
    return camera, images


def full(uv_mm: float, theta_deg: float) -> PoseUncertainty:
    """Of these standard deviations, every two of u, v and theta correlated by 0.6."""
    sigma = np.array([uv_mm / 1e3, uv_mm / 1e3, np.radians(theta_deg)])
    return PoseUncertainty(np.outer(sigma, sigma) * np.where(np.eye(3) == 1, 1, 0.6))


def refined(f: np.ndarray, sigma: PoseUncertainty, planner: GraspPlanner) -> object:
    return RobustFunction(f, sigma).highest(planner.refinement)


def timed(function: Callable[[], object]) -> tuple[float, float]:
    """Milliseconds of the clock, and of processors."""
    clock, processors = time.perf_counter(), time.process_time()
    function()
    return 1e3 * (time.perf_counter() - clock), 1e3 * (time.process_time() - processors)


def compare(planner: GraspPlanner, camera: Camera, images: list[np.ndarray], repeats: int) -> None:
    network = ggcnn2()
    print(f"GG-CNN2: {sum(weights.numel() for weights in network.parameters())} weights")
    for kind, sigma in (("diagonal", PoseUncertainty.of(5, 10)), ("full", full(5, 10))):
        taken = np.empty((repeats, 2, 2))
        for i in range(-3, repeats):  # the first compile and fill caches
            image = images[i % len(images)]
            ours = lambda image=image, sigma=sigma: planner.plan(image, camera, sigma)  # noqa: E731
            theirs = lambda image=image: plan_as_ggcnn2(network, image)  # noqa: E731
            pair = [timed(one) for one in ((ours, theirs) if i % 2 else (theirs, ours))]
            if i >= 0:
                taken[i] = pair if i % 2 else pair[::-1]
        for name, ms in (("graspfn", taken[:, 0]), ("GG-CNN2", taken[:, 1])):
            clock, processors = ms.T
            print(
                f"{kind} Sigma, image to pose, {name}: median {np.median(clock):.1f} ms, fastest {clock.min():.1f} "
                f"(processors: median {np.median(processors):.1f}, least {processors.min():.1f})"
            )
        ratios = np.median(taken[:, 1] / taken[:, 0], axis=0)
        print(f"{kind} Sigma: GG-CNN2 takes {ratios[0]:.2f} times our time, {ratios[1]:.2f} times our processors'")


def parts(planner: GraspPlanner, camera: Camera, images: list[np.ndarray], repeats: int) -> None:
    wanted = dataclasses.replace(planner.table, max_offset_mm=np.inf)
    sight = look(images[0], camera, planner.input, wanted)
    mask, inputs = object_mask(sight.seen), sight.inputs
    f = np.where(meets(mask, planner.gripper), planner.predict(inputs)[0], 0.0)
    steps: dict[str, Callable[[], object]] = {
        "table": lambda: fit_table(images[0], camera, wanted),
        "height map": lambda: height_map(images[0], sight.camera),
        "one whole object": lambda: refusal(sight, planner.fewest_px, planner.most_m),
        "network": lambda: planner.predict(inputs),
        "where it meets": lambda: meets(mask, planner.gripper),
    }
    for kind, make in (("diagonal", PoseUncertainty.of), ("full", full)):
        for sigma in SIGMAS:
            of = functools.partial(refined, f, make(*sigma), planner)
            steps[f"smoothing and refinement, {kind} {sigma[0]:g} mm {sigma[1]:g} deg"] = of
    for name, step in steps.items():
        clock, processors = np.array([timed(step) for _ in range(repeats + 3)])[3:].T
        print(
            f"{name}: median {np.median(clock):.2f} ms, fastest {clock.min():.2f} "
            f"(processors: median {np.median(processors):.2f}, least {processors.min():.2f})"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("model", type=Path, nargs="?", default=DEFAULT)
    parser.add_argument("--repeats", type=int, default=100)
    parser.add_argument("--threads", type=int, default=2, help="that torch and OpenCV may take")
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    cv2.setNumThreads(args.threads)
    planner, (camera, images) = GraspPlanner.load(args.model), scenes(20)
    refused = [found for image in images if not isinstance(found := planner.plan(image, camera, full(5, 10)), Grasp)]
    print(f"{len(images)} images, {len(refused)} of them refused; {args.threads} threads")
    compare(planner, camera, images, args.repeats)
    parts(planner, camera, images, args.repeats)


if __name__ == "__main__":
    main()
