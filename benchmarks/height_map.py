"""From depth image to height map: milliseconds, the table's fit included, and how far the map is from the truth.

    python benchmarks/height_map.py --repeats 200

Of the paper's camera at three sizes of its image, with the noise of the parameters; on one thread, the best of many
repeats and their median. Then, of a box under every camera of conf/camera and three tilts, the fit's errors and the
map's.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from graspfn.compose import compose
from graspfn.geometry.transforms import rotation_z, translation
from graspfn.imaging.camera import Camera
from graspfn.imaging.disturbances import turned
from graspfn.imaging.height_map import CELL_M, SHAPE, height_map
from graspfn.imaging.noise import add_noise
from graspfn.imaging.render import render_depth
from graspfn.imaging.sight import look
from graspfn.imaging.table import fit_table
from graspfn.params import validate
from graspfn.seeds import generator

BOX = 0.1, 0.06, 0.08  # m


def milliseconds(function: Callable[[], object], repeats: int) -> np.ndarray:
    """(repeats,) of one call each, after a first that compiles."""
    function()
    taken = []
    for _ in range(repeats):
        started = time.perf_counter()
        function()
        taken.append(1e3 * (time.perf_counter() - started))
    return np.array(taken)


def print_times(repeats: int) -> None:
    params = validate(compose([]))
    mesh, T = trimesh.creation.box(BOX), translation(0, 0, BOX[2] / 2)
    for width, height, focal in ((320, 240, 285.0), (640, 480, 570.0), (1280, 960, 1140.0)):
        camera = Camera(width, height, (focal, focal, (width - 1) / 2, (height - 1) / 2))
        depth = add_noise(render_depth(mesh, T, camera), params.noise, generator(0, "bench", width))
        for name, function in {
            "fit": lambda camera=camera, depth=depth: fit_table(depth, camera, params.table),
            "map": lambda camera=camera, depth=depth: height_map(depth, camera),
            "both": lambda camera=camera, depth=depth: look(depth, camera, "height_map", params.table).seen,
        }.items():
            taken = milliseconds(function, repeats)
            print(f"{width:4} x {height:3} {name:4} best {taken.min():6.2f} ms, median {np.median(taken):6.2f} ms")


def print_errors() -> None:
    """Of the fit: height and tilt. Of the map: mean and spread of table and top, and how much wider the box is."""
    mesh, T = trimesh.creation.box(BOX), rotation_z(0.5) @ translation(0, 0, BOX[2] / 2)
    y, x = ((n - 1) / 2 - np.arange(n) for n in SHAPE)
    local = np.stack(np.meshgrid(-x * CELL_M, y * CELL_M), axis=-1) @ T[:2, :2]
    out = np.maximum(np.abs(local[..., 0]) - BOX[0] / 2, np.abs(local[..., 1]) - BOX[1] / 2)
    print("camera, tilt: fit's height [mm], tilt [deg]; table mean, std [mm]; top mean, std [mm]; edge outwards [mm]")
    for choice in sorted(path.stem for path in Path("conf/camera").glob("*.yaml")):
        params = validate(compose([f"camera={choice}", "networks=[fcn]"]))
        for tilt in (0.0, 10.0, 19.0):
            camera = turned(Camera.from_params(params.camera), np.radians(tilt), 0.7)
            depth = add_noise(render_depth(mesh, T, camera), params.noise, generator(0, "bench", choice))
            fit = fit_table(depth, camera, params.table)
            seen = height_map(depth, camera.at(fit.T_world_camera))
            table, top = 1e3 * seen.heights[seen.seen & (out > 2 * CELL_M)], 1e3 * seen.heights[out < -CELL_M]
            area = (seen.heights > BOX[2] / 2).sum() * CELL_M**2
            wider = 1e3 * (area - BOX[0] * BOX[1]) / (2 * (BOX[0] + BOX[1]))
            off, high = 1e3 * (fit.height_m - camera.position[2]), top.mean() - 1e3 * BOX[2]
            print(
                f"{choice:14} {tilt:4.0f}: {off:6.3f} {fit.tilt_deg - tilt:6.3f}; "
                f"{table.mean():5.2f} {table.std():4.2f}; {high:5.2f} {top.std():4.2f}; {wider:5.2f}"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=200)
    print_times(parser.parse_args().repeats)
    print_errors()


if __name__ == "__main__":
    main()
