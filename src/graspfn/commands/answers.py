"""What `graspfn plan` says of a grasp: a line of JSON, or words."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from graspfn.planning.planner import Grasp, NoGrasp


def answer(image: str, found: Grasp | NoGrasp, model: str) -> dict[str, Any]:
    """What goes into a line of JSON. Lengths are metres, angles radians; no number is lost."""
    fit = None if found.table is None else dataclasses.asdict(found.table)
    if fit:
        del fit["T_world_camera"]
    about = {"image": image, "table_fit": fit, "model": model}
    if isinstance(found, NoGrasp):
        return {"no_grasp": found.reason} | about
    (x, y, turn), (u, v, theta) = found.pixel.tolist(), found.q.tolist()
    told: dict[str, Any] = {
        "pixels": {"x": x, "y": y, "theta_rad": turn},
        "table": {"u_m": u, "v_m": v, "theta_rad": theta, "z_m": found.z_m},
    }
    if found.T_robot_grasp is not None:
        told["robot"] = {
            "position_m": found.T_robot_grasp[:3, 3].tolist(),
            "quaternion_xyzw": Rotation.from_matrix(found.T_robot_grasp[:3, :3]).as_quat().tolist(),
        }
    scores = {"method": str(found.method), "score": found.score, "robust_score": found.robust_score}
    return told | scores | about


def in_words(told: dict[str, Any]) -> str:
    """The same for people."""
    if "no_grasp" in told:
        return f"{told['image']}: no grasp: {told['no_grasp']}"
    pixels, table, fit = told["pixels"], told["table"], told["table_fit"]
    lines = [
        f"{told['image']}: {told['method']}, promises {told['robust_score']:.2f} (without errors {told['score']:.2f})",
        f"  image  x {pixels['x']:.1f} px, y {pixels['y']:.1f} px, closing at {np.degrees(pixels['theta_rad']):.1f}°",
        f"  table  u {1000 * table['u_m']:.1f} mm, v {1000 * table['v_m']:.1f} mm, "
        f"theta {np.degrees(table['theta_rad']):.1f}°, fingertips {1000 * table['z_m']:g} mm up",
    ]
    if "robot" in told:
        position = ", ".join(f"{value:.4f}" for value in told["robot"]["position_m"])
        turn = ", ".join(f"{value:.4f}" for value in told["robot"]["quaternion_xyzw"])
        lines.append(f"  robot  ({position}) m, quaternion xyzw ({turn})")
    if fit:
        lines.append(
            f"  camera {fit['height_m']:.3f} m over the table, tilted by {fit['tilt_deg']:.1f}°; "
            f"{fit['inliers']:.0%} of what it measured is table, {1000 * fit['rms_m']:.1f} mm rms"
        )
    return "\n".join(lines)
