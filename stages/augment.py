"""Draw the motions and noise seeds of the augmented training samples (paper VII)."""

from pathlib import Path

import numpy as np
import pandas as pd

from graspfn.learning.augmentation import augmentation_table
from graspfn.params import Declared
from graspfn.workflow.files import write_parquet
from graspfn.workflow.stage import stage

MAPS, INDEX = Path("data/images/train_heights.npy"), Path("data/images/train.parquet")
OUT = Path("data/augmentation.parquet")


@stage("augment")
def main(params: Declared) -> None:
    maps = np.load(MAPS, mmap_mode="r")
    ids = pd.read_parquet(INDEX)["id"].tolist()
    write_parquet(OUT, augmentation_table(maps, ids, params.augment, params.seed))


if __name__ == "__main__":
    main()
