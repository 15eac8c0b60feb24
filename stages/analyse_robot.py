"""Which trials succeeded and how far the gripper missed its pose, from the recordings alone (paper VII-B)."""

import shutil
from pathlib import Path

from graspfn.params import Declared
from graspfn.robot.analyse import analyse
from graspfn.robot.covariance_file import file_name, write_covariance
from graspfn.robot.described import read_table
from graspfn.robot.read import recordings, recordings_folder
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
    folder = recordings_folder(params.robot)
    found = analyse(recordings(folder), params.topics, params.arm, read_table(folder))
    for reason in found.unused["reason"]:
        print(f"left out: {reason}")
    found.check(params.robot.max_failed)
    for trial in found.trials.to_dict("records"):
        for odd in filter(None, (trial["flags"], trial["doubts"])):
            print(f"{trial['file']}: {odd}")
    write_parquet(TRIALS, found.trials)
    write_parquet(UNCERTAINTY, found.uncertainty)
    write_parquet(UNUSED, found.unused)
    shutil.rmtree(COVARIANCE, ignore_errors=True)
    for measured in found.measured:
        write_covariance(COVARIANCE / file_name(measured.label), measured)
        if measured.outliers:
            print(f"{measured.label}: outliers, not in Sigma: {', '.join(measured.outliers)}")
    print(found.uncertainty.to_string(index=False))


if __name__ == "__main__":
    main()
