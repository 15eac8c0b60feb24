"""A grasp attempt in MuJoCo, as alike to DART's as two engines can be (physics/attempt.py): a second opinion on labels.

The table touches the object alone, with the same points; the hand's fingers have the same torque, drive friction and
limits. A drag keeps them from closing faster than their drives allow, and takes some more inertia. Only convex objects:
MuJoCo takes the convex hull of every mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from graspfn.geometry.transforms import T_world_grasp, apply
from graspfn.meshes.mass import mass_properties
from graspfn.meshes.placed import Resting
from graspfn.params import LOOK_MS
from graspfn.physics import bodies
from graspfn.physics.attempt import CLEAR_M, Frame, Outcome, Result
from graspfn.physics.gripper import Kinematics
from graspfn.physics.world import Rig

HEAVY_KG = 1e6  # nothing that an object does changes the speed of so heavy a hand: it moves as if prescribed


@dataclass(frozen=True)
class Contact:
    """What MuJoCo's contacts have that Coulomb's law for rigid bodies has not.

    stiff_steps: time constant of a contact in time steps, no less than 2; None: MuJoCo's 20 ms. impedance: share of a
    contact's force that is not softness, below 1. impratio: how much harder friction is than the normal force, which
    holds creep down.
    """

    stiff_steps: float | None = 2.0
    impedance: tuple[float, float] = (0.99, 0.99)
    impratio: float = 100.0


HARD = Contact()  # as near to rigid bodies as the time step allows
ADVISED = Contact(stiff_steps=None, impedance=(0.9, 0.95), impratio=10.0)  # MuJoCo's defaults, and its advice on slip


class MujocoGrasper:
    """Runs attempts on one resting convex object, each from the same state; all of them to the end."""

    def __init__(self, resting: Resting, rig: Rig, contact: Contact = HARD):
        self.resting, self.attempt = resting, rig.attempt
        self.kinematics = Kinematics.from_params(rig.gripper)
        self.points = bodies.sole(resting.mesh)
        mujoco.set_mju_user_warning(lambda message: None)  # run looks at them; else a log file keeps them
        self.model = mujoco.MjModel.from_xml_string(_mjcf(resting, self.points, self.kinematics, rig, contact))
        self.data = mujoco.MjData(self.model)
        self._object = self.model.geom("object").id
        self._look = round(LOOK_MS / 1e3 / self.model.opt.timestep)

    def run(self, q: np.ndarray, film: bool = False) -> Result:
        """Attempt a grasp at pose q = (u, v, theta), metres and radians; `film` keeps the frames."""
        data, T = self.data, T_world_grasp(q)
        mujoco.mj_resetData(self.model, data)
        data.mocap_pos[0], data.mocap_quat[0] = T[:3, 3], _quaternion(T)
        data.joint("object").qpos = [*self.resting.T_world_object[:3, 3], *_quaternion(self.resting.T_world_object)]
        for side in ("left", "right"):
            data.joint(side).qpos = self.kinematics.open
        data.ctrl[:] = 1.0
        frames: list[Frame] = []
        speed = self.attempt.lift_speed_mms / 1e3
        for seconds, rise in ((self.attempt.close_s, 0.0), (self.attempt.lift_mm / 1e3 / speed, speed)):
            data.joint("rise").qvel = rise
            looks = round(seconds * 1e3 / LOOK_MS)
            for _ in range(looks if film else 1):
                mujoco.mj_step(self.model, data, self._look * (1 if film else looks))
                if film:
                    frames.append(self._frame())
        mujoco.mj_forward(self.model, data)
        if any(warning.number for warning in data.warning):
            return Result(Outcome.DIVERGED, frames=tuple(frames))
        held = self.lowest_point() > CLEAR_M and self.hand_touches_object()
        return Result(Outcome.HELD if held else Outcome.LEFT, frames=tuple(frames))

    def hand_touches_object(self) -> bool:
        """Whether palm or fingers meet the object in the present state; the table meets its sole instead."""
        return bool((self.data.contact.geom == self._object).any())

    def lowest_point(self) -> float:
        """Height of the object's lowest point, metres."""
        return float(apply(self._object_pose(), self.points)[:, 2].min())

    def _object_pose(self) -> np.ndarray:
        x, y, z, *quaternion = self.data.joint("object").qpos
        T = np.eye(4)
        T[:3, :3] = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
        T[:3, 3] = x, y, z
        return T

    def _frame(self) -> Frame:
        rise, left, right = (float(self.data.joint(name).qpos[0]) for name in ("rise", "left", "right"))
        return Frame(float(self.data.time), rise, (left, right), self._object_pose())


def _mjcf(resting: Resting, points: np.ndarray, k: Kinematics, rig: Rig, contact: Contact) -> str:
    """The model. contype and conaffinity pair object with gripper, and sole with table.

    The drag is a bias of the actuator, since a joint's damping is implicit and would take from the grip.
    """
    step = rig.physics.time_step_ms / 1e3
    mass, inertia = mass_properties(resting.mesh, rig.physics.density_kgm3)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    soft = "" if contact.stiff_steps is None else f'solref="{contact.stiff_steps * step} 1"'
    firm = f'"{2 * step} 1"'
    stops = f'solreflimit={firm} solimplimit="0.99 0.99 0.001" solreffriction={firm} solimpfriction="0.999 0.999 0.001"'
    (T_palm, palm_size), *fingers = k.parts((0.0, 0.0))
    chain = ""
    drag = (k.effort - k.friction) / k.speed
    inertia = np.maximum(k.inertia, 1.5 * drag * step)  # with less, the drag would turn a finger round within a step
    for side, name, (T, size) in zip((-1, 1), ("left", "right"), fingers, strict=True):
        root = _text(k.finger(side, 0.0)[:3, 3])
        motion = f'type="hinge" axis="0 {side} 0"' if k.turns else f'type="slide" axis="{-side} 0 0"'
        # As in DART, the centre of mass of a finger that turns sits on its axis.
        chain += f"""<body name="{name}" gravcomp="1">
          <inertial pos="{root}" mass="{1.0 if k.turns else inertia}" diaginertia="{_text([inertia] * 3)}"/>
          <joint name="{name}" {motion} pos="{root}" limited="true"
            range="{k.open - 1e-3} {k.closed}" frictionloss="{k.friction}" {stops}/>
          {_box(T, size)}</body>"""
    motors = "".join(
        f'<general joint="{name}" gainprm="{k.effort}" biastype="affine" biasprm="0 0 {-drag}"/>'
        for name in ("left", "right")
    )
    return f"""<mujoco>
      <compiler angle="radian"/>
      <option timestep="{step}" integrator="Euler" cone="elliptic" impratio="{contact.impratio}"
        jacobian="dense" tolerance="1e-12"/>
      <default><geom condim="3" friction="{rig.physics.friction}" solimp="{_text(contact.impedance)} 0.001" {soft}
        contype="0" conaffinity="0"/></default>
      <asset>
        <mesh name="object" vertex="{_text(resting.collision.vertices)}"/>
        <mesh name="sole" vertex="{_text(points)}"/>
      </asset>
      <worldbody>
        <geom name="table" type="plane" size="1 1 1" contype="1"/>
        <body><freejoint name="object"/>
          <inertial pos="0 0 0" mass="{mass}" fullinertia="{_text([xx, yy, zz, xy, xz, yz])}"/>
          <geom name="object" type="mesh" mesh="object" contype="2"/>
          <geom name="sole" type="mesh" mesh="sole" conaffinity="1"/></body>
        <body mocap="true"><body name="hand" gravcomp="1">
          <inertial pos="0 0 0" mass="{HEAVY_KG}" diaginertia="1 1 1"/>
          <joint name="rise" type="slide" axis="0 0 1"/>
          {_box(T_palm, palm_size)}{chain}</body></body>
      </worldbody>
      <actuator>{motors}</actuator>
    </mujoco>"""


def _box(T: np.ndarray, size: np.ndarray) -> str:
    pose = f'pos="{_text(T[:3, 3])}" quat="{_text(_quaternion(T))}"'
    return f'<geom type="box" {pose} size="{_text(size / 2)}" conaffinity="2"/>'


def _quaternion(T: np.ndarray) -> np.ndarray:
    """(4,) w, x, y, z of a transform (4, 4)."""
    return Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True)


def _text(numbers: object) -> str:
    return " ".join(map(repr, np.ravel(np.asarray(numbers, dtype=float)).tolist()))
