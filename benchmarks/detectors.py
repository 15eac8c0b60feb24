"""DART's collision detectors against treatments of a concave mesh, on grasps whose outcome is known (docs/physics.md).

    python benchmarks/detectors.py --poses 8

Treatments: the raw triangles (thousands), the collision mesh that the workflow makes, and CoACD's convex parts
(`pip install 'graspfn[bench]'`). Every shape is tried in a process of its own: some cells take it down.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import trimesh
from known import Known, known_grasps
from objects import committed, results_of, rig_of
from worlds import WatchedGrasper

from graspfn.evaluation.statistics import proportion
from graspfn.params import Meshes
from graspfn.physics.world import DETECTORS
from graspfn.selection.collision import collision_mesh
from graspfn.workflow.cores import cores

TREATMENTS = ("raw", "decimated", "parts")


@dataclass(frozen=True)
class Tried:
    """What came of the poses of one shape: right (n,), held (n,), measured depth (n,) in m, seconds each (n,)."""

    right: np.ndarray
    held: np.ndarray
    depth: np.ndarray
    seconds: np.ndarray


def pieces_of(mesh: trimesh.Trimesh, treatment: str, meshes: Meshes) -> list[trimesh.Trimesh]:
    """What a gripper touches of a mesh; metres."""
    if treatment == "raw":
        return [mesh]
    if treatment == "decimated":
        return [collision_mesh(mesh, meshes.collision_faces, meshes.collision_tolerance_mm / 1e3)]
    import coacd

    coacd.set_log_level("error")
    parts = coacd.run_coacd(coacd.Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces)), seed=0)
    return [trimesh.Trimesh(vertices, faces).convex_hull for vertices, faces in parts]


def attempt(known: Known, detector: str, pieces: Sequence[trimesh.Trimesh]) -> Tried:
    rig = replace(known.rig, physics=replace(known.rig.physics, detector=detector))
    grasper = WatchedGrasper(known.resting, rig, pieces)
    rows = []
    for q in known.poses:
        started = time.process_time()
        held = grasper.run(q).held
        seconds = time.process_time() - started - grasper.world.watching
        rows.append((held == known.holds, held, grasper.world.depth, seconds))
    return Tried(*map(np.array, zip(*rows, strict=True)))


def row_of(detector: str, treatment: str, cell: list[tuple[Known, Tried | Exception]]) -> dict[str, str]:
    """A line of the table."""
    done = [(known, tried) for known, tried in cell if not isinstance(tried, Exception)]
    died = [f"{known.name}: {tried}" for known, tried in cell if isinstance(tried, Exception)]
    for line in died:
        print(f"{detector}, {treatment}: {line}")
    row = {"detector": detector, "treatment": treatment}
    if done:
        right = np.concatenate([tried.right for _, tried in done])
        share = proportion(right, np.repeat(np.arange(len(done)), [len(tried.right) for _, tried in done]))
        row["right"] = f"{share.value:.3f} ({share.low:.2f}-{share.high:.2f})"
        for name, holds in (("good held", True), ("bad failed", False)):
            kept = [tried.right for known, tried in done if known.holds is holds]
            row[name] = f"{np.concatenate(kept).mean():.3f}" if kept else "-"
        accepted = np.concatenate([tried.depth[tried.held] for _, tried in done])
        row["deepest, mm"] = f"{1e3 * accepted.max():.2f}" if len(accepted) else "-"
        row["ms each"] = f"{1e3 * np.concatenate([tried.seconds for _, tried in done]).mean():.0f}"
    return row | {"shapes lost": f"{len(died)} of {len(cell)}"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=4, help="of each shape")
    parser.add_argument("--workers", type=int, default=cores())
    parser.add_argument("--detectors", nargs="+", choices=tuple(DETECTORS), default=list(DETECTORS))
    parser.add_argument("--treatments", nargs="+", choices=TREATMENTS, default=list(TREATMENTS))
    arguments = parser.parse_args()
    if "parts" in arguments.treatments and importlib.util.find_spec("coacd") is None:
        sys.exit("treatment parts: coacd not installed (pip install 'graspfn[bench]')")
    params = committed()
    shapes = list(known_grasps(rig_of(params), arguments.poses, np.random.default_rng(params.seed)))
    good = sum(known.holds for known in shapes)
    print(f"{len(shapes)} shapes x {arguments.poses} poses: {good} that hold, {len(shapes) - good} that fail")
    rows = []
    for treatment in arguments.treatments:
        cut = [(known.resting.mesh, treatment, params.meshes) for known in shapes]
        pieces = []
        for known, made in zip(shapes, results_of(pieces_of, cut, arguments.workers, treatment), strict=True):
            if isinstance(made, Exception):
                sys.exit(f"{treatment} of {known.name}: {made}")
            pieces.append(made)
        faces = np.mean([sum(len(piece.faces) for piece in made) for made in pieces])
        print(f"{treatment}: {max(map(len, pieces))} pieces at most, {faces:.0f} faces on average")
        for detector in arguments.detectors:
            tasks = [(known, detector, made) for known, made in zip(shapes, pieces, strict=True)]
            tried = results_of(attempt, tasks, arguments.workers, f"{detector}, {treatment}")
            rows.append(row_of(detector, treatment, list(zip(shapes, tried, strict=True))))
    print(pd.DataFrame(rows).fillna("-").to_string(index=False))
    print("reproduce: python benchmarks/" + " ".join(["detectors.py", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
