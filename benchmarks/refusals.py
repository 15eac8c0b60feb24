"""Scenes with one whole object on the table: how many the planner refuses, and why.

    python benchmarks/refusals.py MODEL --scenes 200

Test objects of the run in data/, anywhere in the view and on Q, under every camera of conf/camera at up to 1.4 times
its height and the most tilt that a model takes, with the amounts of conf/noise/sensors.yaml. Every refusal is wrong.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import numpy as np
import trimesh

from graspfn.compose import compose
from graspfn.evaluation.objects import PlacedObjects
from graspfn.geometry.transforms import T_world_scene, apply, rotation_z
from graspfn.imaging.camera import Camera, straight_down
from graspfn.imaging.disturbances import WAVE_M, missing, stepped, turned, waves
from graspfn.imaging.noise import add_noise
from graspfn.imaging.render import render_depth
from graspfn.params import Noise, validate
from graspfn.planning.objects import HALF_M
from graspfn.planning.planner import GraspPlanner, NoGrasp
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.seeds import generator

MARGIN_PX, EDGE_M, SPECK_M = 3, 0.005, 0.1
TRIES = 200


def standing(camera: Camera, most_tilt_deg: float, rng: np.random.Generator) -> Camera:
    """Somewhere over the table, looking at its middle, with +u along the image's x: as the planner places its world."""
    height = camera.table_depth * rng.uniform(0.95, 1.4)
    tilted = turned(
        camera.at(straight_down(height)), np.radians(most_tilt_deg) * rng.random(), 2 * np.pi * rng.random()
    )
    T = tilted.T_world_camera
    return tilted.at(rotation_z(-np.arctan2(T[1, 0], T[0, 0])) @ T)


def place(mesh: trimesh.Trimesh, T: np.ndarray, camera: Camera, rng: np.random.Generator) -> np.ndarray | None:
    """T_world_object (4, 4) of a place where all of it is in the view and on Q; None where none is found."""
    for _ in range(TRIES):
        placed = T_world_scene(rng.uniform(-HALF_M, HALF_M), 2 * np.pi * rng.random()) @ T
        points = apply(placed, mesh.vertices)
        pixels = camera.project(points)[:, :2]
        last = np.array([camera.width, camera.height]) - 1 - MARGIN_PX
        if (np.abs(points[:, :2]) <= HALF_M).all() and ((pixels >= MARGIN_PX) & (pixels <= last)).all():
            return placed
    return None


def shadows(mesh: trimesh.Trimesh, T: np.ndarray, depth: np.ndarray, camera: Camera, beside: np.ndarray) -> np.ndarray:
    """(height, width) bool: pixels whose points the projector at `beside` (3,) does not reach."""
    points = camera.deproject(depth).reshape(-1, 3)
    rays = beside - points
    T_object_world = np.linalg.inv(T)
    starts = apply(T_object_world, points + 0.001 * rays / np.linalg.norm(rays, axis=1, keepdims=True))
    return mesh.ray.intersects_any(starts, rays @ T_object_world[:3, :3].T).reshape(depth.shape)


def sensed(mesh: trimesh.Trimesh, T: np.ndarray, camera: Camera, noise: Noise, rng: np.random.Generator) -> np.ndarray:
    """(height, width) float32, metres, NaN for no measurement: what learning/sensor.py does to height maps, done to
    the image."""
    exact = render_depth(mesh, T, camera)
    side = rng.uniform(0, 2 * np.pi)
    across = camera.T_world_camera[:3, :2] @ [np.cos(side), np.sin(side)]
    nothing = shadows(mesh, T, exact, camera, camera.position + noise.baseline_mm / 1000 * rng.random() * across)
    depth = add_noise(exact, noise, rng)
    shape = depth.shape
    down, along = (
        np.abs(np.diff(exact, axis=axis, prepend=exact[:1] if axis == 0 else exact[:, :1])) for axis in (0, 1)
    )
    wrong = (np.maximum(down, along) > EDGE_M) & (rng.random(shape) < noise.edges * rng.random())
    between = rng.random(shape) < 0.5
    depth = np.where(wrong & between, depth + rng.random(shape) * (exact.max() - depth), depth)
    depth = depth + noise.wave_mm / 1000 * rng.random() * waves(camera, WAVE_M, rng)
    depth = stepped(depth * (1 + noise.scale * rng.uniform(-1, 1)), noise.step_mm / 1000 * rng.random())
    specks = rng.random(shape) < noise.specks * rng.random()
    depth = np.where(specks, depth - SPECK_M * rng.random(shape), depth)
    holes = missing(camera, rng)(noise.holes * rng.random())
    return np.where(nothing | (wrong & ~between) | holes, np.nan, depth).astype(np.float32)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("model", type=Path)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--keep", type=Path, help="folder to save refused images in")
    args = parser.parse_args()
    planner, objects = GraspPlanner.load(args.model), PlacedObjects(Path("data"))
    choices = {
        path.stem: validate(compose([f"camera={path.stem}", "noise=sensors", "networks=[fcn]"]))
        for path in sorted(Path("conf/camera").glob("*.yaml"))
    }
    reasons: Counter[str] = Counter()
    for i in range(args.scenes):
        rng = generator(0, "refusals", i)
        name = objects.names[i % len(objects.names)]
        choice = list(choices)[i % len(choices)]
        params, resting = choices[choice], objects.resting(name)
        T = None
        while T is None:
            camera = standing(Camera.from_params(params.camera), planner.table.max_tilt_deg, rng)
            T = place(resting.mesh, resting.T_world_object, camera, rng)
        depth = sensed(resting.mesh, T, camera, params.noise, rng)
        found = planner.plan(depth, camera, PoseUncertainty.of(5, 10), posed=False)
        if isinstance(found, NoGrasp):
            reasons[found.reason.partition(":")[0]] += 1
            tilt, height = np.degrees(camera.tilt), camera.position[2]
            top = 1000 * apply(T, resting.mesh.vertices)[:, 2].max()
            print(f"scene {i}: {name}, {top:.0f} mm high, {choice}, {height:.2f} m, {tilt:.1f} deg: {found.reason}")
            if args.keep:
                args.keep.mkdir(parents=True, exist_ok=True)
                np.savez(args.keep / f"{i}.npz", depth=depth, T=camera.T_world_camera, K=camera.K, D=camera.distortion)
    refused = sum(reasons.values())
    print(f"{refused} of {args.scenes} scenes refused ({refused / args.scenes:.1%}): {dict(reasons)}")


if __name__ == "__main__":
    main()
