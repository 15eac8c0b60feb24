"""Which trials succeeded, why others did not, and how far the gripper missed, from the recordings alone (VII-B)."""

import shutil
from pathlib import Path

from graspfn.params import Declared
from graspfn.reporting.failures import write_failures
from graspfn.robot.analyse import analyse
from graspfn.robot.covariance_file import file_name, write_covariance
from graspfn.robot.described import read_tables
from graspfn.robot.read import recordings
from graspfn.robot.replan import Replanner
from graspfn.robot.source import source_of
from graspfn.workflow.files import write_parquet
from graspfn.workflow.stage import stage

NETWORKS = Path("data/networks")
TRIALS, UNCERTAINTY, UNUSED, COVARIANCE, FAILURES = (
    Path("data/robot_trials.parquet"),
    Path("data/robot_uncertainty.parquet"),
    Path("data/robot_unused.parquet"),
    Path("data/robot_covariance"),
    Path("data/robot_failures"),
)


@stage("analyse_robot")
def main(params: Declared) -> None:
    folder, arm = source_of(params.robot, params.arm, params.gripper)
    bags = recordings(folder)
    table, topics, compute = read_tables(folder, bags), params.topics, params.compute
    networks = {name: NETWORKS / f"{name}-{params.training_seeds[0]}" for name in params.networks}
    again = Replanner.of(networks, params.plan, params.seed, params.camera, params.table, params.gripper)
    found = analyse(bags, topics, arm, table, folder, again, compute)
    for reason in found.unused["reason"]:
        print(f"left out: {reason}")
    found.check(params.robot.max_failed)
    for line in found.oddities():
        print(line)
    print(found.reasons())
    for out in (COVARIANCE, FAILURES):
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir(parents=True)
    write_failures(FAILURES, found.trials, folder, topics, arm, table, params.gripper.opening_mm, again, compute)
    write_parquet(TRIALS, found.trials)
    write_parquet(UNCERTAINTY, found.uncertainty)
    write_parquet(UNUSED, found.unused)
    for measured in found.measured:
        write_covariance(COVARIANCE / file_name(measured.label), measured)
        print(measured.text())


if __name__ == "__main__":
    main()
