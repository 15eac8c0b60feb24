"""Settling and labelling one mesh of the user's own, and drawing what came out (paper IV-A to IV-C)."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from graspfn.formats.reading import read_mesh
from graspfn.geometry import grid
from graspfn.imaging.camera import Camera
from graspfn.imaging.renderers import renderer
from graspfn.meshes.errors import MeshError, RejectedMeshError, printable
from graspfn.meshes.mass import mass_properties
from graspfn.meshes.placed import RESTING, Resting
from graspfn.params import Compute, Params
from graspfn.physics.labelling import Labels, joined, label_object
from graspfn.physics.settling import settle
from graspfn.physics.world import GraspWorld, Rig, TableWorld
from graspfn.reporting.figures.depth_images import draw_depth
from graspfn.reporting.figures.grasp_functions import draw_grasp_function
from graspfn.reporting.figures.simulated_grasps import draw_simulated_grasp, film_scenes
from graspfn.reporting.figures.style import png_bytes
from graspfn.reporting.film import film_best_grasp
from graspfn.seeds import generator
from graspfn.selection.cleaning import clean
from graspfn.selection.selection import at_scale
from graspfn.workflow.child import Died, alone
from graspfn.workflow.files import write_npz
from graspfn.workflow.parallel import map_objects

MIN_CM, MAX_CM = 1.0, 30.0  # of the largest extent: the camera looks down from 41 cm, and Q spans 33 cm
MESH, LABELS, ACCOUNT = "object.ply", "labels.npz", "account.json"
DEPTH, FUNCTION, FILM = "depth.png", "grasp_function.png", "film.png"
ROWS = {  # entries of the account, as they are told
    "attempts": "attempts",
    "untouched": "  culled: touch nothing",
    "collided": "  culled: start inside the object",
    "simulated": "  simulated",
    "stopped_failed": "    stopped early, failed",
    "stopped_held": "    stopped early, held",
    "ran_to_end": "    ran to the end",
    "ran_away": "    diverged",
    "retried": "    (run again at half the step)",
    "held": "held, a success",
}


def label_mesh(path: Path, out: Path, params: Params, seed: int, size_cm: float | None) -> dict[str, Any]:
    """Label one mesh file into the folder `out`; returns what account.json holds.

    size_cm: the largest extent to scale the mesh to; None takes its unit for metres. MeshError says what is wrong.
    """
    rig = Rig(params.physics, params.gripper, params.attempt)
    camera, attempts = Camera.from_params(params.camera), params.label.attempts
    resting, depth, about = _apart(_resting, path, params, seed, size_cm, camera)
    GraspWorld(resting, rig.physics, rig.gripper)  # a gripper that cannot be shows here
    try:  # before the long part, so that a folder that cannot be written shows here
        out.mkdir(parents=True, exist_ok=True)
        (out / DEPTH).write_bytes(png_bytes(draw_depth(depth, camera)))
        resting.mesh.export(out / MESH)
    except OSError as error:
        raise MeshError(f"--out {out}: cannot be written ({error.strerror})") from None
    started = time.monotonic()
    labels, core_s = _labels(resting, attempts, rig, seed, params.compute)
    seconds = time.monotonic() - started
    poses = {"q": grid.poses(), "T_world_object": resting.T_world_object}
    write_npz(out / LABELS, {"successes": labels.successes, "attempts": np.array(attempts)} | poses)
    f = labels.successes / attempts
    (out / FUNCTION).write_bytes(png_bytes(draw_grasp_function(depth, f, camera)))
    (out / FILM).unlink(missing_ok=True)  # of an earlier run
    film = film_best_grasp(printable(path.stem), resting, labels.successes, rig)
    if film:
        (out / FILM).write_bytes(png_bytes(draw_simulated_grasp(film_scenes(film))))
    account = about | {
        "account": {"attempts": attempts * f.size, "simulated": labels.simulated} | labels.account,
        "poses": {"all": f.size, "ever_held": int((f > 0).sum()), "always_held": int((f == 1).sum())},
        "seconds": round(seconds, 2),
        "core_seconds": round(core_s, 2),  # in which one core would have done it
        "attempts_per_s": round(attempts * f.size / seconds, 1),
        "simulated_per_core_s": round(labels.simulated / core_s, 1),
        "files": [str(out / name) for name in (LABELS, ACCOUNT, MESH, DEPTH, FUNCTION, *([FILM] if film else []))],
    }
    (out / ACCOUNT).write_text(json.dumps(account, indent=1) + "\n")
    return account


def _apart(function: Callable[..., Any], path: Path, *arguments: Any) -> Any:
    """What a function makes of a mesh file in a process of its own, lest libraries take this one down with theirs."""
    line = tqdm(desc=f"{path.name}: clean and settle", bar_format="{desc}", leave=False, disable=None)
    with line:
        try:
            return alone(function, path, *arguments)
        except Died:
            why = "a library crashed on it, or there was too little memory"
            raise MeshError(f"{path}: the process that cleaned and settled it died ({why}); mend the mesh") from None


def _resting(
    path: Path, params: Params, seed: int, size_cm: float | None, camera: Camera
) -> tuple[Resting, np.ndarray, dict[str, Any]]:
    """The mesh cleaned as the selection cleans, at its size, where it came to rest; its depth image; what to say of it.

    All that a mesh not yet known to be sound goes through.
    """
    raw = read_mesh(path)
    try:
        cleaned = clean(raw)
    except RejectedMeshError as reason:
        raise MeshError(f"{path}: {reason}") from None
    own_m = float(cleaned.mesh.extents.max())
    size_m = own_m if size_cm is None else size_cm / 100
    if not MIN_CM <= 100 * size_m <= MAX_CM:
        unit = "; if its unit is not the metre, give --size CM" if size_cm is None else ""
        raise MeshError(f"{path}: {100 * size_m:.6g} cm long, where it takes {MIN_CM:g} to {MAX_CM:g}{unit}")
    mesh, collision = at_scale(cleaned.mesh, size_m / own_m, params.meshes)
    settled = settle(mesh, params.physics, params.settle, generator(seed, "place_objects"))
    if settled.status != RESTING:
        raise MeshError(f"{path}: {settled.status}; another --seed drops it in another orientation")
    TableWorld(mesh, params.physics, collision)  # settling takes no collision mesh
    depth = renderer(params.camera.renderer)(mesh, settled.T_world_object, camera)
    about = {"mesh": str(path), "seed": seed, "size_m": mesh.extents.tolist(), "scale": size_m / own_m}
    about |= {"mass_kg": mass_properties(mesh, params.physics.density_kgm3)[0], "cleaning": cleaned.steps}
    return Resting(mesh, collision, settled.T_world_object), depth, about | {"collision_faces": len(collision.faces)}


def _part(angle: int, resting: Resting, attempts: int, rig: Rig, seed: int) -> tuple[Labels, float]:
    """The labels at one angle of Q, and the seconds of processor time that they took."""
    started = time.thread_time()
    labels = label_object(resting, attempts, rig, generator(seed, "label_grasps"), slice(angle, angle + 1))
    return labels, time.thread_time() - started


def _labels(resting: Resting, attempts: int, rig: Rig, seed: int, compute: Compute) -> tuple[Labels, float]:
    """The labels at all poses of Q, an angle to a worker, and the seconds of processor time of all workers."""
    angles = range(grid.SHAPE[2])
    tasks = ((str(angle), (angle, resting, attempts, rig, seed)) for angle in angles)
    parts: dict[int, tuple[Labels, float]] = {}
    for angle, result in map_objects(
        _part, tasks, len(angles), compute, "label", parts=len(angles), attempts=lambda part: part[0].simulated
    ):
        if isinstance(result, Exception):  # its worker died three times
            raise MeshError(f"labels at angle {angle}: {result}") from result
        parts[int(angle)] = result
    return joined([parts[angle][0] for angle in angles]), sum(seconds for _, seconds in parts.values())


def table(account: dict[str, Any]) -> str:
    """What `label_mesh` returns, for people to read."""
    counts, poses = account["account"], account["poses"]
    size = " x ".join(f"{100 * extent:.1f}" for extent in account["size_m"])
    lines = [f"{account['mesh']}: {size} cm, {1000 * account['mass_kg']:.0f} g, at rest; seed {account['seed']}", ""]
    for entry, told in ROWS.items():
        lines.append(f"{told:<36}{counts[entry]:>8,}{100 * counts[entry] / counts['attempts']:>7.1f}%")
    lines += [
        "",
        f"{poses['all']} poses: {poses['ever_held']} ever held, {poses['always_held']} at every attempt",
        f"{account['seconds']:.1f} s, {account['attempts_per_s']:,.0f} attempts/s; {account['core_seconds']:.1f} s of"
        f" one core, {account['simulated_per_core_s']:.0f} simulated attempts/s",
        "",
        *account["files"],
    ]
    if not any(file.endswith(FILM) for file in account["files"]):
        lines.append(f"no {FILM}: none of the best poses holds at the middle of its cell")
    return printable("\n".join(lines))
