"""Train a network to predict the grasp function (paper V)."""

from pathlib import Path

import numpy as np
import pandas as pd

from graspfn.imaging.camera import Camera
from graspfn.learning.dataset import Samples, inputs_of
from graspfn.learning.targets import GraspTargets
from graspfn.learning.training import resources, train
from graspfn.learning.weights import load_pretrained, save_network
from graspfn.params import Declared
from graspfn.workflow.files import read_npz
from graspfn.workflow.stage import stage

IMAGES, TABLE, LABELS = Path("data/images"), Path("data/augmentation.parquet"), Path("data/labels/train.npz")
PRETRAINED, OUT = Path("data/pretrained"), Path("data/networks")


@stage("train")
def main(params: Declared) -> None:
    labels = read_npz(LABELS)
    table = pd.read_parquet(TABLE)
    ids = pd.read_parquet(IMAGES / "train.parquet")["id"]
    # An object whose labelling failed has an image but no label: its samples are left out.
    place = {name: i for i, name in enumerate(labels["ids"].tolist())}
    table = table[table["row"].map(ids).isin(place.keys())].reset_index(drop=True)
    successes = np.zeros((len(ids), *labels["successes"].shape[1:]), dtype=np.uint8)
    for row, name in enumerate(ids):
        if name in place:
            successes[row] = labels["successes"][place[name]]
    inputs = inputs_of(params.network.input, IMAGES, table, Camera.from_params(params.camera), params.noise)
    samples = Samples(table, inputs, GraspTargets(successes, int(labels["attempts"]), table))
    run, seed = "-".join(params.items), params.seed + int(params.items[1])
    network = load_pretrained(PRETRAINED / run, seed)
    scratch = resources(params.compute, f"train-{run}")
    history = train(network, samples, params.train, params.network, seed, scratch)
    folder = OUT / run
    save_network(folder, network, params.network)
    history.to_csv(folder / "history.csv", index=False)


if __name__ == "__main__":
    main()
