"""Draw the objects to train and to test on, each with a size (paper III)."""

from pathlib import Path

import pandas as pd

from graspfn.meshes.selection import select
from graspfn.meshes.store import write_objects
from graspfn.params import Declared
from graspfn.workflow.files import write_parquet
from graspfn.workflow.stage import stage

OUT = Path("data/objects")


@stage("select_meshes")
def main(params: Declared) -> None:
    selection = select(params.meshes, params.seed)
    for split in ("train", "test"):
        manifest = write_objects(OUT / split, getattr(selection, split))
        classes = ", ".join(f"{count} {name}" for name, count in manifest["class"].value_counts().items())
        print(f"{split}: {len(manifest)} objects ({classes})")
    rejects = pd.DataFrame(selection.rejects, columns=["split", "name", "reason"]).astype(str)
    write_parquet(OUT / "rejects.parquet", rejects)
    for reject in selection.rejects:
        print(f"rejected {reject['name']}: {reject['reason']}")


if __name__ == "__main__":
    main()
