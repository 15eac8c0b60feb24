"""Predict the grasp function of every noisy test image with one network (paper V, VII-A)."""

from pathlib import Path

import numpy as np
import pandas as pd
from tqdm import tqdm

from graspfn.imaging.camera import Camera
from graspfn.imaging.noise import observe
from graspfn.imaging.sight import look
from graspfn.learning.device import pick_device
from graspfn.learning.folder import input_kind
from graspfn.learning.prediction import predict_both
from graspfn.learning.weights import load_network
from graspfn.params import Declared
from graspfn.workflow.files import write_npz
from graspfn.workflow.stage import stage

GRID = 1024  # steps of the scores that are kept: far less than five attempts tell; half precision holds them exactly
IMAGES, NETWORKS, OUT = Path("data/images"), Path("data/networks"), Path("data/functions")


@stage("predict")
def main(params: Declared) -> None:
    ids = pd.read_parquet(IMAGES / "test.parquet")["id"].tolist()
    images = np.load(IMAGES / "test.npy", mmap_mode="r")
    camera = Camera.from_params(params.camera)
    run = "-".join(params.items)
    kind = input_kind(NETWORKS / run)
    inputs = np.stack(
        [
            look(observe(image, params.noise, params.seed, name), camera, kind, params.table).inputs
            for image, name in tqdm(zip(images, ids, strict=True), desc="observe", total=len(ids), unit="image")
        ]
    )
    scores, likeliest = predict_both(load_network(NETWORKS / run), inputs, pick_device(params.compute.device))
    scores = (np.round(scores * np.float32(GRID)) / np.float32(GRID)).astype(np.float16)
    predicted = {"ids": np.array(ids), "input": np.array(kind), "scores": scores, "likeliest": likeliest}
    write_npz(OUT / f"{run}.npz", predicted)


if __name__ == "__main__":
    main()
