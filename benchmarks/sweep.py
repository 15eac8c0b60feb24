"""How torque, friction, density and closing time were chosen: what each changes in the labels (docs/physics.md).

    python benchmarks/sweep.py --objects 30

Every setting labels every object anew. In a good one nearly every object that fits the gripper has a pose at which all
attempts hold, and the best pose of the true grasp function, smoothed with 5 mm and 10 degrees, stands being missed by
as much.
"""

from __future__ import annotations

import argparse
import dataclasses
import time

import numpy as np
import pandas as pd
from objects import committed, finished, resting_objects, results_of, rig_of

from graspfn.evaluation.statistics import proportion
from graspfn.geometry.transforms import apply
from graspfn.meshes.placed import Resting
from graspfn.params import Plan
from graspfn.physics.attempt import Grasper
from graspfn.physics.labelling import label_object
from graspfn.physics.world import Rig
from graspfn.planning.methods import robust_best_grasp
from graspfn.planning.robust import RobustFunction
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.reporting.sizes import narrowest_width
from graspfn.seeds import generator
from graspfn.workflow.cores import cores

SIGMA = PoseUncertainty.of(uv_mm=5.0, theta_deg=10.0)
TRIALS = 20  # of each object's best pose
SETTINGS: tuple[dict[str, float], ...] = (  # changes of params.yaml, of as many sections as it takes
    {},
    {"friction": 0.6},
    {"friction": 0.8},
    {"torque_nm": 0.5, "gear_friction_nm": 0.05},
    {"torque_nm": 2.0, "gear_friction_nm": 0.2},
    {"density_kgm3": 150.0},
    {"density_kgm3": 600.0},
    {"closing_speed_rads": 0.75, "close_s": 0.8},
    {"close_s": 0.8},
)


def changed(rig: Rig, setting: dict[str, float]) -> Rig:
    """The rig with the keys of a setting changed, in whichever section has them."""
    sections = {}
    for section in dataclasses.fields(rig):
        own = getattr(rig, section.name)
        keys = {field.name for field in dataclasses.fields(own)}
        sections[section.name] = dataclasses.replace(own, **{key: v for key, v in setting.items() if key in keys})
    return Rig(**sections)


def study(name: str, resting: Resting, rig: Rig, plan: Plan, attempts: int, seed: int) -> dict[str, float | str]:
    """One object under one setting."""
    started = time.process_time()
    labels = label_object(resting, attempts, rig, generator(seed, "sweep", name))
    seconds = time.process_time() - started
    f = labels.successes / attempts
    q = robust_best_grasp(RobustFunction(f, SIGMA), plan, generator(seed, "sweep", name, "plan"))
    grasper, rng = Grasper(resting, rig), generator(seed, "sweep", name, "trials")
    held = [q is not None and grasper.run(SIGMA.reached(q, rng.standard_normal(3))).held for _ in range(TRIALS)]
    height = float(np.ptp(apply(resting.T_world_object, resting.mesh.vertices)[:, 2]))
    return {
        "object": name,
        "low": height < grasper.world.kinematics.height,
        "sure": labels.successes.max() == attempts,
        "robust": float(np.mean(held)),
        "held": labels.account["held"] / max(labels.simulated, 1),
        "seconds": seconds,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, default=10)
    parser.add_argument("--attempts", type=int, default=5, help="at each pose of Q")
    parser.add_argument("--settings", type=int, default=len(SETTINGS), help="only the first so many")
    parser.add_argument("--workers", type=int, default=cores())
    arguments = parser.parse_args()
    params = committed()
    opening = params.gripper.opening_mm / 1e3
    objects = resting_objects(params, arguments.objects, arguments.workers)
    fitting = [
        (name, resting) for name, resting in objects if narrowest_width(resting.mesh, resting.T_world_object) < opening
    ]
    print(f"{len(fitting)} of {len(objects)} objects are narrower than the gripper's {1e3 * opening:g} mm")
    rows = []
    for setting in SETTINGS[: arguments.settings]:
        rig, label = changed(rig_of(params), setting), ", ".join(f"{k} {v:g}" for k, v in setting.items())
        tasks = [(name, resting, rig, params.plan, arguments.attempts, params.seed) for name, resting in fitting]
        names = (name for name, _ in fitting)
        results = results_of(study, tasks, arguments.workers, label or "committed")
        table = pd.DataFrame([one for _, one in finished(names, results)])
        sure, robust = (
            proportion(table["sure"].to_numpy()),
            proportion(table["robust"].to_numpy(), np.arange(len(table))),
        )
        rows.append(
            {
                "setting": label or "as committed",
                "objects": len(table),
                "with a pose that always holds": f"{sure.value:.2f} ({sure.low:.2f}-{sure.high:.2f})",
                "robust pose succeeds": f"{robust.value:.2f} ({robust.low:.2f}-{robust.high:.2f})",
                "held of simulated": f"{table['held'].mean():.3f}",
                "s per object": f"{table['seconds'].mean():.1f}",
            }
        )
        print(pd.DataFrame(rows[-1:]).to_string(index=False, header=len(rows) == 1), flush=True)
        low = table[table["low"]]
        print(f"  lower than the palm: {low['sure'].sum()} of {len(low)}, {low['robust'].mean():.2f}; ", end="")
        print("no pose always holds " + (", ".join(table["object"][~table["sure"]]) or "none"), flush=True)


if __name__ == "__main__":
    main()
