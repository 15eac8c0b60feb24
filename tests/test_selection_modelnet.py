"""Real ModelNet files: all come through cleaning to a settled pose, from a folder as from a zip."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from physics_params import PARAMS, PHYSICS, SETTLE

from graspfn.formats.reading import read_mesh
from graspfn.geometry.transforms import apply
from graspfn.meshes.placed import RESTING
from graspfn.physics.settling import settle
from graspfn.selection.candidate import Candidate
from graspfn.selection.files import files_of
from graspfn.selection.selection import make_object

SAMPLES = Path(__file__).parents[1] / "../shared/data/modelnet_off"
pytestmark = pytest.mark.skipif(not SAMPLES.is_dir(), reason="the ModelNet samples are not beside this checkout")


@pytest.mark.parametrize("name", [path.stem for path in sorted(SAMPLES.glob("*.off"))])
def test_every_sample_is_cleaned_and_comes_to_rest(name):
    raw = read_mesh(SAMPLES / f"{name}.off")
    candidate = Candidate(f"modelnet40-{name}", "modelnet40", name, "", "", "")
    drawn = make_object(candidate, raw, PARAMS.meshes, 0)
    assert drawn.row["size_m"] == pytest.approx(drawn.mesh.extents.max())
    assert drawn.row["collision_faces"] <= max(drawn.row["faces"], PARAMS.meshes.collision_faces)
    settled = settle(drawn.mesh, PHYSICS, SETTLE, np.random.default_rng(0))
    assert settled.status == RESTING
    assert apply(settled.T_world_object, drawn.mesh.vertices)[:, 2].min() == pytest.approx(0, abs=1e-3)


def test_a_zip_holds_the_same_meshes_as_the_folder(tmp_path):
    names = [path.name for path in sorted(SAMPLES.glob("*.off"))]
    with zipfile.ZipFile(tmp_path / "samples.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for name in names:
            archive.write(SAMPLES / name, name)
    folder, packed = files_of(SAMPLES), files_of(tmp_path / "samples.zip")
    assert folder.names == packed.names == names
    for name in names:
        assert np.array_equal(folder.load(name).triangles, packed.load(name).triangles)
