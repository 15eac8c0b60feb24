"""The skeletons of a grasp's world: table, object and gripper (paper III-A)."""

from __future__ import annotations

import tempfile
from pathlib import Path

import dartpy as dart
import numpy as np
import trimesh
from scipy.spatial import ConvexHull

from graspfn.meshes.mass import mass_properties
from graspfn.params import Gripper
from graspfn.physics.gripper import Kinematics

SOLE_POINTS = 60  # a hull with more vertices is thinned out, to so many or as many more as SOLE_M takes
SOLE_M = 1e-3  # by which thinning may lower an object on the table
POINT_M = 1e-4  # radius of a point: DART has none without one
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
        planes = ConvexHull(points[kept]).equations
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
    """A free body with the mass of `mesh` that meets the gripper with `collision`, and glued to it one of `points`.

    points: (n, 3) of `sole`, which meet the table; a mesh would meet it with a hundred doubled contacts on a flat face,
    and steps of milliseconds. DART reads meshes through URDF alone, so one is written for the loader.
    """
    touch = '<collision><geometry><mesh filename="object.obj"/></geometry></collision>' if collision else ""
    mass, inertia = mass_properties(mesh, density)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    urdf = f"""<robot name="object"><link name="object">
        <inertial><mass value="{mass}"/>
        <inertia ixx="{xx}" ixy="{xy}" ixz="{xz}" iyy="{yy}" iyz="{yz}" izz="{zz}"/></inertial>
        {touch}
    </link></robot>"""
    with tempfile.TemporaryDirectory(prefix="graspfn-") as folder:
        if collision:
            collision.export(Path(folder) / "object.obj")
        path = Path(folder) / "object.urdf"
        path.write_text(urdf)
        skeleton = dart.utils.DartLoader().parseSkeleton(str(path))
    if skeleton is None:
        raise ValueError("DART could not load the mesh")
    _, glued = skeleton.createWeldJointAndBodyNodePair(skeleton.getBodyNode(0))
    inertia = dart.dynamics.Inertia()
    inertia.setMass(mass * TINY)
    inertia.setMoment(np.diag([xx, yy, zz]) * TINY)
    glued.setInertia(inertia)
    ball = dart.dynamics.SphereShape(POINT_M)
    for vertex in points:
        shape = glued.createShapeNode(ball)
        shape.createCollisionAspect()
        shape.createDynamicsAspect()
        shape.setRelativeTranslation(vertex * (1 - POINT_M / np.linalg.norm(vertex)))
    return skeleton


def hand(k: Kinematics, gripper: Gripper) -> dart.dynamics.Skeleton:
    """Palm on a kinematic vertical slide, fingers on torque-driven revolute joints."""
    hand = dart.dynamics.Skeleton("hand")
    slide, palm = hand.createPrismaticJointAndBodyNodePair()
    slide.setAxis([0, 0, 1])
    slide.setActuatorType(dart.dynamics.ActuatorType.VELOCITY)
    (T_palm, palm_size), *fingers = k.parts((0.0, 0.0))
    _add_box(palm, palm_size, T_palm[:3, 3], mass=1.0)
    for side, (_, size) in zip((-1, 1), fingers, strict=True):
        joint, finger = hand.createRevoluteJointAndBodyNodePair(palm)
        joint.setAxis([0, side, 0])
        joint.setTransformFromParentBodyNode(_isometry([side * k.knuckle_x, 0, k.knuckle_z]))
        joint.setActuatorType(dart.dynamics.ActuatorType.FORCE)
        # Two fingers under equal torques are in balance wherever they stand: without the friction of their drives the
        # pair drifts sideways with the object.
        joint.setCoulombFriction(0, gripper.gear_friction_nm)
        joint.setPositionLowerLimit(0, k.open_angle - 1e-3)
        joint.setPositionUpperLimit(0, k.closed_angle)
        joint.setLimitEnforcement(True)
        _add_box(finger, size, [0, 0, -k.length / 2], mass=1.0, about_y=gripper.finger_inertia_kgm2)
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


def _isometry(translation: list[float]) -> dart.math.Isometry3:
    T = dart.math.Isometry3()
    T.set_translation(translation)
    return T


def set_friction(skeleton: dart.dynamics.Skeleton, friction: float) -> None:
    for body in skeleton.getBodyNodes():
        for shape in body.getShapeNodes():
            shape.getDynamicsAspect().setFrictionCoeff(friction)
            shape.getDynamicsAspect().setRestitutionCoeff(0.0)
