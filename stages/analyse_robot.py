"""Which trials succeeded and how far the gripper missed its pose, from the recordings alone (paper VII-B)."""

from pathlib import Path

from graspfn.params import Declared
from graspfn.robot.analyse import analyse
from graspfn.robot.read import recordings
from graspfn.workflow.files import write_parquet
from graspfn.workflow.stage import stage

RECORDINGS, TRIALS, UNCERTAINTY = (
    Path("data/recordings"),
    Path("data/robot_trials.parquet"),
    Path("data/robot_uncertainty.parquet"),
)


@stage("analyse_robot")
def main(params: Declared) -> None:
    trials, uncertainty = analyse(recordings(RECORDINGS), params.topics)
    write_parquet(TRIALS, trials)
    write_parquet(UNCERTAINTY, uncertainty)
    print(uncertainty.to_string(index=False))


if __name__ == "__main__":
    main()
