"""Grasps whose outcome is known beforehand, on shapes convex and concave.

A grasp through the middle of an object holds where its weight is well below the friction of two pads, 2 μN, and the
surfaces it closes on lean well inside the friction cone; well beyond either limit it fails, as it does where the hand
starts inside the object or the fingers meet none of it. N is bounded by the effort of the drives less or more their
friction, over the longest or the shortest arm there is. A wall held beside the centre of mass also bears a moment: the
friction on its two faces has the thickness of the wall for an arm. Heavy ends, flat plates and tall things held by
their feet are left out: what two points hold may swing about the line between them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from trimesh.creation import annulus, cylinder, icosphere

from graspfn.geometry.transforms import translation
from graspfn.meshes.placed import Resting
from graspfn.physics.gripper import Kinematics, Revolute
from graspfn.physics.world import Rig

FACES = 5000  # at least: as many as scans and CAD have, not the few that a shape needs
SAFE, HOPELESS = 0.2, 2.0  # load over the most that friction bears
MILD, STEEP = 1 / 3, 2.0  # friction that a slope needs, over what there is
JITTER = np.array([3e-3, 3e-3, np.radians(3)])  # poses are uniform within so much of the nominal one


@dataclass(frozen=True)
class Known:
    """Grasps of one object that all hold, or all fail."""

    name: str
    resting: Resting
    rig: Rig
    poses: np.ndarray  # (n, 3)
    holds: bool


@dataclass(frozen=True)
class Shape:
    """A mesh (m) standing on the table, where to grasp it, and how much of one pad's friction bears its weight."""

    name: str
    mesh: trimesh.Trimesh
    q: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: float = float(JITTER[2])
    pads: float = 2.0


def known_grasps(rig: Rig, count: int, rng: np.random.Generator) -> Iterator[Known]:
    """Every shape with `count` poses, first those that hold."""
    k, friction = Kinematics.from_params(rig.gripper), rig.physics.friction
    for holds, shapes in ((True, holding(friction)), (False, blocked())):
        for shape in shapes:
            yield _known(shape, _loaded(shape, SAFE, rig, k), count, holds, rng)
    for shape in upright():
        heavy = replace(shape, name=f"heavy {shape.name}")
        yield _known(heavy, _loaded(shape, HOPELESS, rig, k), count, False, rng)
    for shape in upright()[:3]:
        light, most = (_loaded(shape, load, rig, k).physics for load in (SAFE, HOPELESS))
        slippery = replace(light, friction=friction * light.density_kgm3 / most.density_kgm3)
        slides = replace(shape, name=f"slippery {shape.name}")
        yield _known(slides, replace(rig, physics=slippery), count, False, rng)
    for shape in sloped(STEEP * friction):
        yield _known(shape, _loaded(shape, SAFE, rig, k), count, False, rng)


def _known(shape: Shape, rig: Rig, count: int, holds: bool, rng: np.random.Generator) -> Known:
    poses = np.array(shape.q) + rng.uniform(-1, 1, (count, 3)) * [*JITTER[:2], shape.turn]
    mesh = shape.mesh
    while len(mesh.faces) < FACES:
        mesh = mesh.subdivide()
    centre = mesh.center_mass
    mesh = trimesh.Trimesh(mesh.vertices - centre, mesh.faces, process=False)
    return Known(shape.name, Resting(mesh, mesh, translation(*centre)), rig, poses, holds)


def _loaded(shape: Shape, load: float, rig: Rig, k: Kinematics) -> Rig:
    """The rig with the density at which the object loads the grasp by so much of what its friction bears."""
    effort, arm = k.effort - k.friction, k.length
    if load > 1:
        effort, arm = k.effort + k.friction, k.height - shape.mesh.bounds[1, 2]
    force = effort / arm if isinstance(k, Revolute) else effort
    weight = load * rig.physics.friction * force * shape.pads
    return replace(rig, physics=replace(rig.physics, density_kgm3=float(weight / 9.81 / shape.mesh.volume)))


def holding(friction: float) -> list[Shape]:
    lying = cylinder(0.02, 0.12).apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    cup = cylinder(0.03, 0.05).difference(cylinder(0.027, 0.05).apply_translation([0, 0, 0.003]))
    neck, lobe = box(0.03, 0.06, 0.02), box(0.09, 0.03, 0.02)
    lobes = (lobe.copy().apply_translation([0, side * 0.045, 0]) for side in (-1, 1))
    frame = box(0.12, 0.12, 0.02).difference(box(0.09, 0.09, 0.1))
    return [
        *upright(),
        *sloped(MILD * friction)[:1],
        Shape("lying cylinder", on_table(lying)),
        Shape("sphere", on_table(icosphere(4, 0.025)), turn=np.pi),
        Shape("cup, across", on_table(cup), turn=np.pi),
        Shape("dumbbell, neck", trimesh.boolean.union([neck, *lobes])),
        Shape("ring, wall", on_table(annulus(0.045, 0.06, 0.02)), (0.0525, 0, 0), pads=15 / 52.5),
        Shape("tube, wall", on_table(annulus(0.037, 0.045, 0.05)), (0.041, 0, 0), pads=8 / 41),
        Shape("frame, bar", on_table(frame), (0.0525, 0, 0), pads=15 / 52.5),
    ]


def upright() -> list[Shape]:
    """Walls are vertical. The first three are wider than the fingers' joints are apart, less a thickness.

    Fingers that turn lean away from what is so wide; on what is narrower they are a funnel that holds without friction.
    """
    hexagon = cylinder(0.05 / np.sqrt(3), 0.05, sections=6)
    return [
        Shape("box", box(0.06, 0.06, 0.04)),
        Shape("cylinder", on_table(cylinder(0.025, 0.06)), turn=np.pi),
        Shape("hexagon", on_table(hexagon), (0, 0, np.pi / 6)),
        Shape("bar", box(0.02, 0.06, 0.015)),
    ]


def sloped(needs: float) -> list[Shape]:
    """A roof whose slopes, and a wedge whose sides, ask for a friction of `needs`."""
    x, depth = 0.03, 0.035
    rise = min(0.04, 0.02 / needs)  # 2 cm or more are left between the slopes at the top
    tops = ((x, 0.0), (x - rise * needs, rise))
    roof = trimesh.Trimesh([(s * w, y, z) for s in (-1, 1) for y in (-x, x) for w, z in tops]).convex_hull
    plan = ((0.0, 0.0), (-depth * needs, -depth), (depth * needs, -depth))
    wedge = trimesh.Trimesh([(w, y, z) for z in (0.0, 0.02) for w, y in plan]).convex_hull
    return [Shape("roof", roof), Shape("wedge", wedge, (0, 0.006, 0))]


def blocked() -> list[Shape]:
    """The hand starts inside the object, or closes on none of it."""
    corner = trimesh.boolean.union([box(0.2, 0.03, 0.03), box(0.03, 0.2, 0.03).apply_translation([-0.085, 0.085, 0])])
    return [
        Shape("too wide a box", box(0.11, 0.11, 0.05)),
        Shape("too tall a box", box(0.04, 0.04, 0.13)),
        Shape("beside a box", box(0.04, 0.06, 0.04), (0, 0.05, 0)),
        Shape("within a ring", on_table(annulus(0.08, 0.095, 0.03))),
        Shape("within a corner", corner, (0.0, -0.085, np.pi / 4)),
    ]


def box(x: float, y: float, z: float) -> trimesh.Trimesh:
    return on_table(trimesh.creation.box([x, y, z]))


def on_table(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    return mesh.apply_translation([0, 0, -mesh.bounds[0, 2]])
