"""Meshes of one's own and ModelNet40, in a directory or a zip of it: the same objects either way."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import trimesh

from graspfn.meshes.errors import MeshError, RejectedMeshError
from graspfn.selection.folder import Folder, class_of
from graspfn.selection.modelnet import ModelNet
from graspfn.workflow.files import write_parquet

RNG = np.random.default_rng(0)
FILES = ("train/{}_0001.off", "train/{}_0002.off", "test/{}_0003.off")
MODELNET = [f"{name}/{file.format(name)}" for name in ("bed", "chair", "cup") for file in FILES]


def write(path, size=1.0):
    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box((size, 1, 1)).export(path)


def folder_of(root, names):
    for k, name in enumerate(names):
        write(root / name, 1 + k)
    return root


def zipped(folder):
    return Path(shutil.make_archive(str(folder), "zip", folder))


def ids(source, split="train", by="shape", seed=0):
    return [candidate.id for candidate in source.candidates(split, seed, by)]


def one_line(caught, *words):
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert str(word) in message


@pytest.mark.parametrize(
    ("name", "category"),
    [
        ("bed/train/bed_0001.off", "bed"),
        ("bed/test/bed_0002.off", "bed"),
        ("cups/red/a.obj", "red"),
        ("cups/a.obj", "cups"),
        ("train/a.obj", ""),
        ("a.obj", ""),
    ],
)
def test_class_is_the_folder_that_holds_the_mesh(name, category):
    assert class_of(name) == category


def test_every_mesh_is_listed_once_and_other_files_are_passed_by(tmp_path):
    names = ["bed/train/a.off", "bed/test/b.off", "cup/a.stl", "loose.obj"]
    folder_of(tmp_path, names)
    (tmp_path / "cup" / "UPPER.OFF").write_bytes((tmp_path / "bed/train/a.off").read_bytes())
    (tmp_path / "bed" / "notes.txt").write_text("not a mesh")
    for hidden in (".trash/a.off", "bed/._a.off", "__MACOSX/bed/a.off"):
        write(tmp_path / hidden)
    source = Folder(tmp_path)
    found = list(source.candidates("train", 3, "shape"))
    assert {(c.name, c.category, c.family) for c in found} == {
        ("bed/train/a.off", "bed", "bed"),
        ("bed/test/b.off", "bed", "bed"),
        ("cup/a.stl", "cup", "cup"),
        ("cup/UPPER.OFF", "cup", "cup"),
        ("loose.obj", "", ""),
    }
    assert source.count == len(found) == len({c.id for c in found})
    assert ids(source, "test", seed=3) == ids(source, "train", seed=3)[::-1]
    assert {c.licence for c in found} == {"not stated"}


def test_ids_are_file_names_whatever_the_files_are_called(tmp_path):
    folder_of(tmp_path, ["Kaffee Tassen/größe #1.off"])
    (candidate,) = Folder(tmp_path).candidates("train", 0, "shape")
    assert candidate.id.startswith("folder-gr_e_1-")
    assert candidate.category == "Kaffee Tassen"
    assert Folder(tmp_path).load(candidate, RNG).volume == pytest.approx(1)


@pytest.mark.parametrize("source", [Folder, ModelNet])
def test_names_that_are_no_utf8_can_be_written_to_a_table_and_their_meshes_read(tmp_path, source):
    names = [f"caf\udce9/train/{name}.off" for name in ("\udce9", "\udce8", "a")]
    folder_of(tmp_path / "meshes", names)
    source = source(tmp_path / "meshes")
    found = list(source.candidates("train", 0, "shape"))
    table = pd.DataFrame([vars(candidate) for candidate in found])
    write_parquet(tmp_path / "t.parquet", table)
    assert pd.read_parquet(tmp_path / "t.parquet").equals(table)
    assert sorted(source.load(candidate, RNG).volume for candidate in found) == pytest.approx([1, 2, 3])


def test_one_more_file_leaves_the_order_of_the_others(tmp_path):
    folder_of(tmp_path, [f"{k}.off" for k in range(12)])
    before = ids(Folder(tmp_path))
    write(tmp_path / "new.off")
    after = ids(Folder(tmp_path))
    assert [name for name in after if "new" not in name] == before
    assert before != sorted(before)
    assert ids(Folder(tmp_path), seed=1) != after


def test_a_folder_and_its_zip_give_the_same_objects(tmp_path):
    root = folder_of(tmp_path / "meshes", ["a/x.off", "a/y.obj", "b/x.stl", "b/z.ply", "c/w.glb"])
    folder, archive = Folder(root), Folder(zipped(root))
    for split in ("train", "test"):
        for by in ("shape", "family"):
            assert list(folder.candidates(split, 0, by)) == list(archive.candidates(split, 0, by))
    for candidate in folder.candidates("train", 0, "shape"):
        assert np.array_equal(folder.load(candidate, RNG).triangles, archive.load(candidate, RNG).triangles)


def test_a_damaged_file_is_rejected_when_it_is_loaded_not_before(tmp_path):
    folder_of(tmp_path / "meshes", ["good.off"])
    (tmp_path / "meshes" / "hollow.off").touch()
    for source in (Folder(tmp_path / "meshes"), Folder(zipped(tmp_path / "meshes"))):
        (hollow,) = (c for c in source.candidates("train", 0, "shape") if c.name == "hollow.off")
        with pytest.raises(RejectedMeshError) as caught:
            source.load(hollow, RNG)
        one_line(caught, "hollow.off", "empty")


@pytest.mark.parametrize("source", [Folder, ModelNet])
def test_missing_folder_and_folder_without_meshes(tmp_path, source):
    with pytest.raises(MeshError) as caught:
        source(tmp_path / "nowhere")
    one_line(caught, tmp_path / "nowhere", "no such", ".off", ".zip")
    (tmp_path / "readme.txt").write_text("nothing here")
    with pytest.raises(MeshError) as caught:
        source(tmp_path)
    one_line(caught, tmp_path, "no mesh in it", ".off")


def test_families_take_two_folders(tmp_path):
    folder_of(tmp_path, ["cups/a.off", "cups/b.off"])
    with pytest.raises(MeshError) as caught:
        ids(Folder(tmp_path), by="family")
    one_line(caught, "meshes.split", "folder", "cups")


def test_modelnet_zipped_unpacked_and_below_a_folder_of_its_name_is_the_same(tmp_path):
    root = folder_of(tmp_path / "all" / "ModelNet40", MODELNET).parent
    write(root / "ModelNet40" / "bed" / "stray.off")  # in neither train nor test
    write(root / "ModelNet40" / "bed" / "train" / "bed_0009.obj")
    sources = [ModelNet(path) for path in (root, root / "ModelNet40", zipped(root))]
    for split in ("train", "test"):
        for by in ("shape", "family"):
            orders = [list(source.candidates(split, 0, by)) for source in sources]
            assert orders[0] == orders[1] == orders[2] != []
    assert {source.count for source in sources} == {float(len(MODELNET))}
    (first, *_) = sources[0].candidates("train", 0, "shape")
    for source in sources:
        place = MODELNET.index(f"{first.category}/train/{first.name}.off")
        assert source.load(first, RNG).volume == pytest.approx(1 + place)


def test_modelnets_own_split_is_honoured_by_shape(tmp_path):
    source = ModelNet(folder_of(tmp_path, MODELNET))
    for split in ("train", "test"):
        own = [f"modelnet40-{Path(name).stem}" for name in MODELNET if f"/{split}/" in name]
        assert sorted(ids(source, split)) == sorted(own)


def test_by_family_both_folders_of_a_class_go_to_one_side(tmp_path):
    source = ModelNet(folder_of(tmp_path, MODELNET))
    sides = [list(source.candidates(split, 0, "family")) for split in ("train", "test")]
    families = [{candidate.family for candidate in side} for side in sides]
    assert len(families[0]) == 2
    assert len(families[1]) == 1
    assert families[0].isdisjoint(families[1])
    assert sum(len(side) for side in sides) == len(MODELNET)


def test_two_modelnet_files_of_one_name_and_another_layout_are_errors(tmp_path):
    folder_of(tmp_path, ["a/bed/train/bed_0001.off", "b/bed/test/bed_0001.off"])
    with pytest.raises(MeshError) as caught:
        ModelNet(tmp_path)
    one_line(caught, "bed_0001", "a/bed/train", "b/bed/test")
    folder_of(tmp_path / "other", ["cups/a.off"])
    with pytest.raises(MeshError) as caught:
        ModelNet(tmp_path / "other")
    one_line(caught, tmp_path / "other", "<class>/train/*.off")
