"""Draw the objects to train on and to test on, each with a size (paper IV-C, VII)."""

import functools
from pathlib import Path

import pandas as pd

from graspfn.params import Declared
from graspfn.selection.selection import REJECTS, select
from graspfn.selection.written import write_objects
from graspfn.workflow.files import write_parquet
from graspfn.workflow.parallel import map_in_order
from graspfn.workflow.stage import stage

OBJECTS, COLLISION = Path("data/objects"), Path("data/collision")


def counts(values: pd.Series) -> str:
    return ", ".join(f"{count} {name or 'of no class'}" for name, count in values.value_counts().items())


@stage("select_meshes")
def main(params: Declared) -> None:
    selection = select(
        params.meshes, params.seed, functools.partial(map_in_order, compute=params.compute, label="clean")
    )
    for split in ("train", "test"):
        manifest = write_objects(OBJECTS / split, COLLISION / split, getattr(selection, split))
        print(f"{split}: {len(manifest)} objects of {manifest['shape'].nunique()} shapes: {counts(manifest['source'])}")
        print(f"{split} by class: {counts(manifest['class'])}")
    rejects = pd.DataFrame(selection.rejects, columns=list(REJECTS)).astype(str)
    write_parquet(OBJECTS / "rejects.parquet", rejects)
    print(
        f"rejected: {len(rejects)}" + (f": {counts(rejects['reason'].str.partition(':')[0])}" if len(rejects) else "")
    )
    for reject in rejects.itertuples():
        print(f"rejected from {reject.split}: {reject.source} {reject.name}: {reject.reason}")


if __name__ == "__main__":
    main()
