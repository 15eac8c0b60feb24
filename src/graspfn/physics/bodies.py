"""The skeletons of a grasp's world: table, object and gripper (paper IV-A)."""

from __future__ import annotations

import tempfile
from pathlib import Path

import dartpy as dart
import numpy as np
import trimesh
from scipy.spatial import ConvexHull, QhullError

from graspfn.meshes.mass import mass_properties
from graspfn.physics.gripper import Kinematics

SOLE_POINTS = 60  # a hull with more vertices is thinned out, to so many or as many more as SOLE_M takes
SOLE_M = 1e-3  # by which thinning may lower an object on the table
TINY = 1e-6  # share of the mass that DART wants of the sole, which is only a surface


def table() -> dart.dynamics.Skeleton:
    """The half-space z < 0."""
    table = dart.dynamics.Skeleton("table")
    _, body = table.createWeldJointAndBodyNodePair()
    shape = body.createShapeNode(dart.dynamics.PlaneShape([0, 0, 1], 0.0))
    shape.createCollisionAspect()
    shape.createDynamicsAspect()
    return table


def sole(mesh: trimesh.Trimesh) -> np.ndarray:
    """(n, 3) vertices of the mesh's convex hull: few, but no vertex is farther than SOLE_M outside the hull of these.

    A body meets a half-space where its convex hull does, so these are all that a table need touch.
    """
    points = np.asarray(mesh.convex_hull.vertices)
    if len(points) <= SOLE_POINTS:
        return points
    i = np.arange(SOLE_POINTS) + 0.5  # even directions first: a Fibonacci spiral on the sphere
    z, turn = 1 - 2 * i / len(i), np.pi * (1 + 5**0.5) * i
    directions = np.column_stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z])
    kept = np.unique(np.argmax(points @ directions.T, axis=0))
    while True:  # every round adds, over each facet, the vertex that sticks out most
        try:
            planes = ConvexHull(points[kept]).equations
        except QhullError:  # those kept lie in one plane, of a body of micrometres
            return points
        heights = points @ planes[:, :3].T + planes[:, 3]
        over, out = heights.argmax(axis=1), heights.max(axis=1)
        order = np.argsort(-out, kind="stable")
        order = order[out[order] > SOLE_M]
        if len(order) == 0:
            return points[kept]
        kept = np.union1d(kept, order[np.unique(over[order], return_index=True)[1]])


def free_object(
    mesh: trimesh.Trimesh, collision: trimesh.Trimesh | None, points: np.ndarray, density: float
) -> dart.dynamics.Skeleton:
    """A free body with the mass of `mesh` that meets the gripper with `collision`; glued to it the hull of `points`.

    points: (n, 3) of `sole`, whose hull alone meets the table. Against a half-space a mesh has one contact at each
    vertex below it; against a box it would have a hundred doubled ones on a flat face, and steps of milliseconds.
    DART reads meshes through URDF alone, so one is written for the loader.
    """
    mass, inertia = mass_properties(mesh, density)
    hull = trimesh.Trimesh(points, process=False).convex_hull
    with tempfile.TemporaryDirectory(prefix="graspfn-") as folder:
        links = [
            _link(Path(folder), "object", mass, inertia, collision),
            _link(Path(folder), "sole", mass * TINY, np.diag(np.diag(inertia)) * TINY, hull),
        ]
        glue = '<joint name="glue" type="fixed"><parent link="object"/><child link="sole"/></joint>'
        path = Path(folder) / "object.urdf"
        path.write_text(f'<robot name="object">{"".join(links)}{glue}</robot>')
        skeleton = dart.utils.DartLoader().parseSkeleton(str(path))
    if skeleton is None:
        raise ValueError("DART could not load the mesh")
    return skeleton


def _link(folder: Path, name: str, mass: float, inertia: np.ndarray, touched: trimesh.Trimesh | None) -> str:
    """A link of a URDF; its mesh goes into a file beside it."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    collision = ""
    if touched:
        # With a normal at each vertex: the loader would make its own per face, and split the vertices for it.
        touched.export(folder / f"{name}.obj", include_normals=True)
        collision = f'<collision><geometry><mesh filename="{name}.obj"/></geometry></collision>'
    return f"""<link name="{name}"><inertial><mass value="{mass}"/>
        <inertia ixx="{xx}" ixy="{xy}" ixz="{xz}" iyy="{yy}" iyz="{yz}" izz="{zz}"/></inertial>{collision}</link>"""


def hand(k: Kinematics) -> dart.dynamics.Skeleton:
    """Palm on a kinematic vertical slide, fingers on joints driven by a torque or force."""
    hand = dart.dynamics.Skeleton("hand")
    slide, palm = hand.createPrismaticJointAndBodyNodePair()
    slide.setAxis([0, 0, 1])
    slide.setActuatorType(dart.dynamics.ActuatorType.VELOCITY)
    (T_palm, palm_size), *fingers = k.parts((0.0, 0.0))
    _add_box(palm, palm_size, T_palm[:3, 3], mass=1.0)
    for side, (_, size) in zip((-1, 1), fingers, strict=True):
        centre = [0, 0, -k.length / 2]
        if k.turns:
            joint, finger = hand.createRevoluteJointAndBodyNodePair(palm)
            joint.setAxis([0, side, 0])
            _add_box(finger, size, centre, mass=1.0, about_y=k.inertia)
        else:
            joint, finger = hand.createPrismaticJointAndBodyNodePair(palm)
            joint.setAxis([-side, 0, 0])
            _add_box(finger, size, centre, mass=k.inertia)
        joint.setTransformFromParentBodyNode(_isometry(k.finger(side, 0.0)[:3, 3]))
        # Commanded a speed, such a drive spends all of its effort to reach it, and what it takes not to exceed it.
        joint.setActuatorType(dart.dynamics.ActuatorType.SERVO)
        joint.setForceUpperLimit(0, k.effort)
        # Two fingers under equal efforts are in balance wherever they stand: without the friction of their drives the
        # pair drifts sideways with the object.
        joint.setCoulombFriction(0, k.friction)
        joint.setPositionLowerLimit(0, k.open - 1e-3)
        joint.setPositionUpperLimit(0, k.closed)
        joint.setLimitEnforcement(True)
        finger.setGravityMode(False)
    return hand


def _add_box(
    body: dart.dynamics.BodyNode,
    size: np.ndarray,
    centre: np.ndarray | list[float],
    mass: float,
    about_y: float | None = None,
) -> None:
    """A solid box with its inertia on a body; centre in the body's frame, `about_y` the moment about its y axis."""
    box = dart.dynamics.BoxShape(size)
    shape = body.createShapeNode(box)
    shape.createCollisionAspect()
    shape.createDynamicsAspect()
    shape.setRelativeTranslation(centre)
    inertia = dart.dynamics.Inertia()
    inertia.setMass(mass)
    moment = box.computeInertia(mass)
    if about_y is None:
        inertia.setLocalCOM(centre)
    else:  # a body that only turns about y: its centre of mass may sit on the axis, so that about_y is all it has
        moment[1, 1] = about_y
    inertia.setMoment(moment)
    body.setInertia(inertia)


def _isometry(translation: np.ndarray) -> dart.math.Isometry3:
    T = dart.math.Isometry3()
    T.set_translation(translation)
    return T


def set_friction(skeleton: dart.dynamics.Skeleton, friction: float) -> None:
    for body in skeleton.getBodyNodes():
        for shape in body.getShapeNodes():
            shape.getDynamicsAspect().setFrictionCoeff(friction)
            shape.getDynamicsAspect().setRestitutionCoeff(0.0)
