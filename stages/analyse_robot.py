"""Which trials succeeded and how far the gripper missed its pose, from the recordings alone (paper VII-B)."""

import shutil
from pathlib import Path

from graspfn.params import Declared
from graspfn.robot.analyse import analyse
from graspfn.robot.covariance_file import file_name, write_covariance
from graspfn.robot.described import read_tables
from graspfn.robot.read import recordings, source_of
from graspfn.workflow.files import write_parquet
from graspfn.workflow.stage import stage

TRIALS, UNCERTAINTY, UNUSED, COVARIANCE = (
    Path("data/robot_trials.parquet"),
    Path("data/robot_uncertainty.parquet"),
    Path("data/robot_unused.parquet"),
    Path("data/robot_covariance"),
)


@stage("analyse_robot")
def main(params: Declared) -> None:
    folder, arm = source_of(params.robot, params.arm)
    bags = recordings(folder)
    found = analyse(bags, params.topics, arm, read_tables(folder, bags), folder)
    for reason in found.unused["reason"]:
        print(f"left out: {reason}")
    found.check(params.robot.max_failed)
    for line in found.oddities():
        print(line)
    write_parquet(TRIALS, found.trials)
    write_parquet(UNCERTAINTY, found.uncertainty)
    write_parquet(UNUSED, found.unused)
    shutil.rmtree(COVARIANCE, ignore_errors=True)
    for measured in found.measured:
        write_covariance(COVARIANCE / file_name(measured.label), measured)
        print(measured.text())


if __name__ == "__main__":
    main()
