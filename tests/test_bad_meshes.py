"""No mesh of a user's takes a process down: bad ones go through every native library that meets them, in a child.

`python tests/test_bad_meshes.py START STOP` does so with other seeds, as many as one likes.
"""

import collections
import subprocess
import sys
import traceback
from dataclasses import replace

import numpy as np
import trimesh
from physics_params import ATTEMPT, GRIPPER, PARAMS, PHYSICS, SETTLE

from graspfn.geometry import grid
from graspfn.imaging.camera import Camera
from graspfn.imaging.render import render_depth
from graspfn.meshes.errors import RejectedMeshError
from graspfn.meshes.placed import RESTING, Resting
from graspfn.physics.attempt import Grasper
from graspfn.physics.bodies import SOLE_M, sole
from graspfn.physics.culling import touches_nothing
from graspfn.physics.settling import settle
from graspfn.physics.world import Rig
from graspfn.selection.cleaning import clean
from graspfn.selection.selection import at_scale
from graspfn.selection.signature import signature

STARTS = (
    lambda: trimesh.creation.box().subdivide(),
    lambda: trimesh.creation.icosphere(1),
    lambda: trimesh.creation.icosphere(3),
    lambda: trimesh.creation.torus(1, 0.3, 12, 8),
    lambda: trimesh.creation.annulus(0.5, 1, 0.3),
    lambda: trimesh.creation.capsule(1, 0.2, count=[8, 8]),
    lambda: trimesh.util.concatenate([trimesh.creation.box(), trimesh.creation.icosphere(2, 0.6)]),
    lambda: trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False),
)
CAMERA = Camera.from_params(PARAMS.camera)


def dropped(rng, vertices, faces):
    return vertices, faces[rng.random(len(faces)) > rng.choice([0.02, 0.3, 0.9])]


def flipped(rng, vertices, faces):
    some = rng.random(len(faces)) < rng.choice([0.02, 0.3, 1])
    return vertices, np.where(some[:, None], faces[:, ::-1], faces)


def repeated(rng, vertices, faces):
    again = faces[rng.random(len(faces)) < rng.choice([0.05, 0.5])]
    return vertices, np.vstack([faces, again[:, ::-1] if rng.random() < 0.5 else again])


def rubbish(rng, vertices, faces):
    return vertices, np.vstack([faces, rng.integers(len(vertices), size=(rng.choice([1, 3, 30]), 3))])


def pinched(rng, vertices, faces):
    """Corners taken from one vertex to another: edges of any number of faces, collapsed faces."""
    owner = np.arange(len(vertices))
    some = rng.integers(len(vertices), size=rng.choice([1, 4, 20]))
    owner[some] = rng.permutation(rng.integers(len(vertices), size=len(some)))
    return vertices, owner[faces]


def not_numbers(rng, vertices, faces):
    vertices[rng.integers(len(vertices)), rng.integers(3)] = rng.choice([np.nan, np.inf, 1e300, -1e200, 1e20])
    return vertices, faces


def shaken(rng, vertices, faces):
    return vertices + rng.normal(scale=rng.choice([1e-12, 1e-8, 1e-3, 0.3]), size=vertices.shape), faces


def gridded(rng, vertices, faces):
    """Coordinates rounded: vertices that coincide, faces without area, walls on walls."""
    step = rng.choice([0.05, 0.3, 1])
    return np.round(vertices / step) * step, faces


def squeezed(rng, vertices, faces):
    vertices[:, rng.integers(3)] *= rng.choice([0, 1e-12, 1e-7, 1e-4, 1e-2])
    return vertices, faces


def scaled(rng, vertices, faces):
    return vertices * 10.0 ** rng.choice([-300, -30, -9, 9, 30, 150]), faces


def far_away(rng, vertices, faces):
    return vertices + 10.0 ** rng.integers(1, 18), faces


def crossing(rng, vertices, faces):
    """A second copy, moved a little or not at all: surfaces that cross or lie in each other."""
    move = rng.choice([0, 1e-9, 0.1, 0.7]) * rng.normal(size=3)
    return np.vstack([vertices, vertices + move]), np.vstack([faces, faces + len(vertices)])


def splintered(rng, vertices, faces):
    """Slivers, loose."""
    count = rng.choice([20, 2000])
    ends = vertices[rng.integers(len(vertices), size=(count, 2))]
    slivers = np.concatenate([ends, ends[:, :1] + rng.normal(scale=1e-9, size=(count, 1, 3))], axis=1).reshape(-1, 3)
    loose = len(vertices) + np.arange(3 * count).reshape(-1, 3)
    return np.vstack([vertices, slivers]), np.vstack([faces, loose])


def souped(rng, vertices, faces):
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


HARMS = (
    dropped, flipped, repeated, rubbish, pinched, not_numbers, shaken, gridded, squeezed, scaled, far_away, crossing,
    splintered, souped,
)  # fmt: skip


def bad_mesh(seed):
    """One to four harms done to a sound mesh."""
    rng = np.random.default_rng(seed)
    start = STARTS[rng.integers(len(STARTS))]()
    vertices, faces = np.array(start.vertices), np.array(start.faces)
    with np.errstate(all="ignore"):
        for harm in rng.choice(HARMS, rng.integers(1, 5), replace=False):
            if len(faces):
                vertices, faces = harm(rng, vertices, faces)
    return trimesh.Trimesh(vertices, faces, process=False)


def faces_of_anything(seed):
    """An odd number of faces between any corners: on two in a hundred, Manifold crashes."""
    rng = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(1)
    return trimesh.Trimesh(ball.vertices, rng.integers(len(ball.vertices), size=(2 * seed % 60 + 5, 3)), process=False)


def cleaned_or_not(raw):
    try:
        return f"cleaned, {clean(raw).mass}"
    except RejectedMeshError as reason:
        return str(reason).partition(":")[0]


def fate(raw, seed):
    """How far a mesh comes: cleaned, scaled, weighed, described, dropped, seen and grasped."""
    try:
        cleaned = clean(raw)
    except RejectedMeshError as reason:
        return str(reason).partition(":")[0]
    mesh, collision = at_scale(cleaned.mesh, 0.1 / float(cleaned.mesh.extents.max()), PARAMS.meshes)
    assert np.isfinite(signature(mesh)).all()
    rng = np.random.default_rng(seed)
    settled = settle(mesh, PHYSICS, replace(SETTLE, limit_s=0.5), rng)
    T = settled.T_world_object
    if settled.status != RESTING and not settled.status.startswith("never"):
        return settled.status
    render_depth(mesh, T, CAMERA)
    resting = Resting(mesh, collision, T)
    grasper = Grasper(resting, Rig(PHYSICS, GRIPPER, ATTEMPT))
    q = grid.sample_cells(1, rng).reshape(-1, 3)
    q = q[~touches_nothing(resting, q, grasper.world.kinematics)]
    for pose in rng.permutation(q)[:2]:
        grasper.run(pose)
    return f"grasped, {cleaned.mass}"


def main(start, stop):
    tasks = [(f"{seed}", fate, (bad_mesh(seed), seed)) for seed in range(start, stop)]
    anything = range(5 * start, 5 * stop)
    tasks += [(f"faces of anything {seed}", cleaned_or_not, (faces_of_anything(seed),)) for seed in anything]
    fates = collections.Counter()
    for name, function, arguments in tasks:
        print(name, end=" ", flush=True)  # the last one is the culprit
        try:
            fates[function(*arguments)] += 1
        except Exception as error:
            traceback.print_exc()
            fates[repr(error)] += 1
        print(dict(fates), flush=True)


def test_a_body_of_micrometres_has_a_sole():
    """A strip, thicker in the middle: the vertices that stick out most in even directions lie in one plane."""
    strip = trimesh.creation.annulus(0.5, 1, 0.3).apply_scale([0.05, 5e-6, 0.05])
    points = sole(strip)
    np.testing.assert_allclose(np.ptp(points, axis=0), strip.extents, atol=SOLE_M)


def test_no_bad_mesh_takes_its_process_down():
    command = [sys.executable, __file__, "0", "60"]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0, f"{ran.returncode} at {ran.stdout.splitlines()[-1:]}\n{ran.stderr}"
    assert "Traceback" not in ran.stderr, ran.stderr


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
