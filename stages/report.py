"""Tables, figures and the page, from what the stages before wrote."""

from pathlib import Path

from graspfn.params import Declared
from graspfn.reporting.inputs import load_inputs
from graspfn.reporting.report import write_report
from graspfn.workflow.files import keep_only
from graspfn.workflow.stage import stage, timings


@stage("report")
def main(params: Declared) -> None:
    keep_only(Path("data/pretrained"), [f"{name}-{seed}" for name in params.networks for seed in params.training_seeds])
    write_report(load_inputs(Path("data"), params, timings()), Path("reports") / params.scale)


if __name__ == "__main__":
    main()
