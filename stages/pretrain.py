"""Pre-train a network to tell the classes of the training objects apart (paper VII)."""

from pathlib import Path

import pandas as pd

from graspfn.imaging.camera import Camera
from graspfn.learning.dataset import Samples, inputs_of
from graspfn.learning.networks import build_network
from graspfn.learning.pretraining import class_indices, pretrain
from graspfn.learning.targets import ClassTargets
from graspfn.learning.training import resources
from graspfn.learning.weights import save_pretrained
from graspfn.params import Declared
from graspfn.workflow.stage import stage

IMAGES, TABLE, OUT = Path("data/images"), Path("data/augmentation.parquet"), Path("data/pretrained")


@stage("pretrain")
def main(params: Declared) -> None:
    classes, names = class_indices(pd.read_parquet(IMAGES / "train.parquet")["class"].tolist())
    table = pd.read_parquet(TABLE)
    table = table[~table["empty"]].reset_index(drop=True)  # nothing has no class
    inputs = inputs_of(params.network.input, IMAGES, table, Camera.from_params(params.camera), params.noise)
    samples = Samples(table, inputs, ClassTargets(classes, table))
    run, seed = "-".join(params.items), params.seed + int(params.items[1])
    network = build_network(params.network, seed)
    scratch = resources(params.compute, f"pretrain-{run}")
    history, notes = pretrain(network, samples, names, params.pretrain, params.network, seed, scratch)
    folder = OUT / run
    save_pretrained(folder, network, params.network, **notes)
    history.to_csv(folder / "history.csv", index=False)


if __name__ == "__main__":
    main()
