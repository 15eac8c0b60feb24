"""Draw the shifts, rotations and noise seeds of the augmented training samples (paper VII)."""

from pathlib import Path

import numpy as np
import pandas as pd

from graspfn.imaging.camera import Camera
from graspfn.learning.augmentation import augmentation_table
from graspfn.params import Declared
from graspfn.workflow.files import write_parquet
from graspfn.workflow.stage import stage

IMAGES, INDEX, OUT = Path("data/images/train.npy"), Path("data/images/train.parquet"), Path("data/augmentation.parquet")


@stage("augment")
def main(params: Declared) -> None:
    images = np.load(IMAGES, mmap_mode="r")
    ids = pd.read_parquet(INDEX)["id"].tolist()
    camera = Camera.from_params(params.camera)
    write_parquet(OUT, augmentation_table(images, ids, camera, params.augment.samples, params.seed))


if __name__ == "__main__":
    main()
