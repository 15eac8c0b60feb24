"""Render depth images: training objects in the middle, test objects at random placements (paper IV-B, VII-A).

Of training objects also the heights as seen from straight above, which networks with input: height_map learn from.
"""

from pathlib import Path

import numpy as np
import pandas as pd
from tqdm import tqdm

from graspfn.geometry.transforms import T_world_scene
from graspfn.imaging.camera import Camera
from graspfn.imaging.orthographic import render_heights
from graspfn.imaging.placement import PLACING, random_placement
from graspfn.imaging.renderers import renderer
from graspfn.meshes.placed import T_world_object, load_placed, read_resting
from graspfn.params import Declared
from graspfn.seeds import generator
from graspfn.workflow.files import write_parquet
from graspfn.workflow.stage import stage

OBJECTS, PLACED, OUT = Path("data/objects"), Path("data/placed"), Path("data/images")


@stage("render_images")
def main(params: Declared) -> None:
    camera = Camera.from_params(params.camera)
    render = renderer(params.camera.renderer)
    OUT.mkdir(parents=True, exist_ok=True)
    for split in ("train", "test"):
        placed = read_resting(PLACED / f"{split}.parquet")
        shape = (len(placed), camera.height, camera.width)
        images = np.lib.format.open_memmap(OUT / f"{split}.npy", "w+", np.float32, shape)
        rows, heights = [], []
        for i, row in enumerate(tqdm(placed.to_dict("records"), desc=f"render {split}", unit="image")):
            mesh, T = load_placed(OBJECTS / split, row), T_world_object(row)
            line = {"row": i, "id": row["id"], "class": row["class"]}
            if split == "test":
                rng = generator(params.seed, "render_images", row["id"])
                shift, theta = random_placement(render(mesh, T, PLACING), rng)
                T = T_world_scene(shift, theta) @ T
                line |= {"shift_u_m": shift[0], "shift_v_m": shift[1], "theta_rad": theta}
            else:
                heights.append(render_heights(mesh, T))
            images[i] = render(mesh, T, camera)
            rows.append(line)
        images.flush()
        if heights:
            np.save(OUT / f"{split}_heights.npy", np.stack(heights))
        write_parquet(OUT / f"{split}.parquet", pd.DataFrame(rows))


if __name__ == "__main__":
    main()
