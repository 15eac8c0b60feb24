"""The split: sizes in range, train and test disjoint, and object i the same whatever the counts."""

import collections
import itertools

import numpy as np
import pytest
import trimesh

from graspfn.meshes.cleaning import solid
from graspfn.meshes.errors import MeshError
from graspfn.meshes.procedural import CATEGORIES
from graspfn.meshes.selection import select
from graspfn.params import Meshes


def procedural(train, test):
    return Meshes(source="procedural", folder=None, train=train, test=test, size_min_cm=5.0, size_max_cm=20.0)


def folder(root, train, test):
    return Meshes(source="folder", folder=str(root), train=train, test=test, size_min_cm=5.0, size_max_cm=20.0)


def ids(objects):
    return [row["id"] for row, _ in objects]


@pytest.fixture
def shapes(tmp_path):
    """Twelve different closed boxes in files of two classes."""
    for k in range(12):
        path = tmp_path / ("a", "b")[k % 2] / "train" / f"box_{k}.off"
        path.parent.mkdir(parents=True, exist_ok=True)
        box = trimesh.creation.box((1, 2 + k, 3)).apply_translation([50, k, -7])
        path.write_text(box.export(file_type="off", digits=12))
    return tmp_path


def test_row_describes_a_mesh_that_is_scaled_and_centred_on_its_mass():
    for row, mesh in select(procedural(len(CATEGORIES), 1), seed=0).train:
        assert 0.05 <= row["size_m"] <= 0.20
        assert row["size_m"] == pytest.approx(mesh.extents.max())
        np.testing.assert_allclose(mesh.center_mass, 0, atol=1e-9)
        assert row["volume_m3"] == pytest.approx(mesh.volume)
        assert row["watertight"]
        assert row["faces"] == len(mesh.faces)
        assert row["id"] == f"procedural-{row['name']}"
        assert row["cleaning"] == "closed"


def test_sizes_are_uniform(shapes):
    """Over many seeds the mean and spread are those of the uniform distribution on [5, 20] cm."""
    sizes = [row["size_m"] for seed in range(25) for row, _ in select(folder(shapes, 6, 6), seed).train]
    assert np.mean(sizes) == pytest.approx(0.125, abs=4 * 0.15 / np.sqrt(12 * len(sizes)))
    assert np.std(sizes) == pytest.approx(0.15 / np.sqrt(12), rel=0.15)


@pytest.mark.parametrize("counts", [(1, 1), (20, 3), (36, 36)])
def test_categories_are_equally_frequent_and_splits_disjoint(counts):
    chosen = select(procedural(*counts), seed=1)
    names = {split: [row for row, _ in getattr(chosen, split)] for split in ("train", "test")}
    for split, wanted in zip(("train", "test"), counts, strict=True):
        assert len({row["id"] for row in names[split]}) == wanted
        frequency = collections.Counter(row["class"] for row in names[split])
        assert max(frequency.values()) - min(frequency[c] for c in CATEGORIES) <= 1
    assert not {row["id"] for row in names["train"]} & {row["id"] for row in names["test"]}


def test_train_and_test_objects_of_a_category_differ_in_shape():
    chosen = select(procedural(len(CATEGORIES), len(CATEGORIES)), seed=0)
    for (train, a), (test, b) in zip(chosen.train, chosen.test, strict=True):
        assert train["class"] == test["class"]
        assert a.volume / a.extents.prod() != pytest.approx(b.volume / b.extents.prod(), rel=1e-6)


def test_larger_counts_begin_with_the_same_objects(shapes):
    for few, many in (
        (procedural(5, 3), procedural(9, 6)),
        (folder(shapes, 2, 3), folder(shapes, 6, 6)),
    ):
        for split in ("train", "test"):
            small, large = getattr(select(few, 4), split), getattr(select(many, 4), split)
            for (row, mesh), (same_row, same_mesh) in itertools.islice(zip(small, large, strict=False), 3):
                assert row == same_row
                assert np.array_equal(mesh.vertices, same_mesh.vertices)


def test_another_seed_is_another_draw(shapes):
    assert ids(select(folder(shapes, 6, 1), 0).train) != ids(select(folder(shapes, 6, 1), 1).train)
    (row, mesh), (other_row, other) = (next(select(procedural(1, 1), seed).train) for seed in (0, 1))
    assert row["id"] == other_row["id"]
    assert mesh.volume != pytest.approx(other.volume)


def test_folder_can_be_used_up_and_no_further(shapes):
    chosen = select(folder(shapes, 7, 5), 0)
    names = ids(chosen.train) + ids(chosen.test)
    assert len(set(names)) == 12
    assert all(name.startswith("folder-box_") for name in names)
    with pytest.raises(MeshError, match="not enough meshes") as caught:
        select(folder(shapes, 7, 6), 0)
    assert str(shapes) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unfit_meshes_are_replaced_and_recorded(shapes):
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2], [0, 1, 3], [0, 3, 2]])
    for k in range(3):
        (shapes / f"sheet_{k}.off").write_text(sheet.export(file_type="off"))
    twin = shapes / "b" / "copy of box_0.off"
    twin.write_bytes((shapes / "a" / "train" / "box_0.off").read_bytes())
    chosen = select(folder(shapes, 6, 6), 0)
    names = ids(chosen.train) + ids(chosen.test)
    assert len(set(names)) == 12
    reasons = {reject["name"]: reject["reason"] for reject in chosen.rejects}
    # the twins are one object: whichever of the two came second was turned down
    assert {name for name in reasons if "box" in name} < {"a/train/box_0.off", "b/copy of box_0.off"}
    assert all("no volume" in reasons[name] for name in reasons if "sheet" in name)
    assert len(reasons) >= 1
    with pytest.raises(MeshError, match="rejected"):
        chosen = select(folder(shapes, 8, 8), 0)
        list(chosen.train), list(chosen.test)


def test_open_mesh_is_centred_on_its_hull(tmp_path):
    for k in range(2):
        box = trimesh.creation.box((1, 2, 3 + k)).subdivide()
        opened = trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 2] < 0.5], process=False)
        opened.apply_translation([0, 9, 0]).export(tmp_path / f"tub_{k}.off")
    for row, mesh in select(folder(tmp_path, 1, 1), 0).train:
        assert row["cleaning"] == "hull mass"
        assert not row["watertight"]
        np.testing.assert_allclose(solid(mesh).center_mass, 0, atol=1e-9)
        assert row["volume_m3"] == pytest.approx(mesh.convex_hull.volume)
        assert row["class"] == ""


def test_damaged_file_stops_the_draw_with_its_name(shapes):
    for path in shapes.rglob("*.off"):
        path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(MeshError, match=r"box_\d+\.off"):
        list(select(folder(shapes, 1, 1), 0).train)
