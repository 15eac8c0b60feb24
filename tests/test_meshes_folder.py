"""A folder of meshes: layouts, formats, headers as found in the wild, and one clear line for what cannot be used."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from graspfn.meshes.errors import MeshError
from graspfn.meshes.folder import SUFFIXES, Folder, class_of, read_mesh

MODELNET = Path(__file__).parents[1] / "../shared/data/modelnet_off"
RNG = np.random.default_rng(0)


def write(path, mesh=None):
    path.parent.mkdir(parents=True, exist_ok=True)
    (mesh or trimesh.creation.icosphere(1)).export(path)
    return path


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


def test_modelnet_layout_is_listed_once_each_and_other_files_are_passed_by(tmp_path):
    for name in ("bed/train/bed_0001.off", "bed/test/bed_0002.off", "cup/train/cup_0001.OFF", "loose.stl"):
        write(tmp_path / name.lower()).rename(tmp_path / name)
    (tmp_path / "bed" / "notes.txt").write_text("not a mesh")
    orders = {split: list(Folder(tmp_path).candidates(split, 3)) for split in ("train", "test")}
    assert orders["train"] == orders["test"][::-1]
    assert sorted(orders["train"]) == [
        ("bed/test/bed_0002.off", "bed"),
        ("bed/train/bed_0001.off", "bed"),
        ("cup/train/cup_0001.OFF", "cup"),
        ("loose.stl", ""),
    ]


def test_one_more_file_leaves_the_order_of_the_others(tmp_path):
    for k in range(12):
        write(tmp_path / f"{k}.off")
    before = [name for name, _ in Folder(tmp_path).candidates("train", 0)]
    write(tmp_path / "new.off")
    after = [name for name, _ in Folder(tmp_path).candidates("train", 0)]
    assert [name for name in after if name != "new.off"] == before
    assert before != sorted(before)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_format_gives_the_same_solid(tmp_path, suffix):
    ball = trimesh.creation.icosphere(2)
    if suffix == ".gltf":
        for name, data in trimesh.exchange.gltf.export_gltf(ball.scene()).items():
            (tmp_path / name.replace("model", "ball")).write_bytes(data)
    else:
        write(tmp_path / f"ball{suffix}", ball)
    mesh = Folder(tmp_path).load(f"ball{suffix}", RNG)
    mesh.merge_vertices(merge_norm=True, merge_tex=True)
    assert mesh.volume == pytest.approx(ball.volume, rel=1e-5)


@pytest.mark.parametrize("header", ["OFF\n", "OFF", "off\n", "", "OFF \n"])
def test_off_headers_as_found_in_modelnet(tmp_path, header):
    tetrahedron = "4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
    path = tmp_path / "t.off"
    path.write_text(header + tetrahedron)
    assert read_mesh(path).volume == pytest.approx(1 / 6)


@pytest.mark.skipif(not MODELNET.is_dir(), reason="the ModelNet samples are not beside this checkout")
def test_real_modelnet_files_load_whole():
    loaded = {path.stem: read_mesh(path) for path in MODELNET.glob("*.off") if "no_header" not in path.stem}
    for name, mesh in loaded.items():
        first = (MODELNET / f"{name}.off").read_text().removeprefix("OFF").split()[:3]
        assert len(mesh.faces) >= int(first[1])  # polygons come as several triangles
    glued, plain = loaded["bathtub_0002_glued_header"], loaded["bathtub_0002"]
    assert np.array_equal(glued.triangles, plain.triangles)
    with pytest.raises(MeshError) as caught:  # vertices only: neither header, nor counts, nor faces
        read_mesh(MODELNET / "bathtub_0001_no_header.off")
    one_line(caught, "bathtub_0001_no_header.off", "OFF")


def test_missing_folder_and_folder_without_meshes(tmp_path):
    with pytest.raises(MeshError) as caught:
        Folder(tmp_path / "nowhere")
    one_line(caught, tmp_path / "nowhere", "no such folder", ".off")
    (tmp_path / "readme.txt").write_text("nothing here")
    with pytest.raises(MeshError) as caught:
        Folder(tmp_path)
    one_line(caught, tmp_path, "no mesh in it", ".off")


def test_an_empty_file_is_named_before_any_mesh_is_drawn(tmp_path):
    write(tmp_path / "good.off")
    (tmp_path / "hollow.off").touch()
    with pytest.raises(MeshError) as caught:
        Folder(tmp_path)
    one_line(caught, tmp_path / "hollow.off", "empty")


@pytest.mark.parametrize("suffix", [s for s in SUFFIXES if s != ".gltf"])
def test_a_file_cut_short_or_of_something_else_is_named(tmp_path, suffix):
    path = write(tmp_path / f"whole{suffix}")
    data = path.read_bytes()
    cut = 200 if suffix == ".obj" else len(data) * 2 // 3  # an .obj may end at any line after its first face
    for name, content in (("cut", data[:cut]), ("text", b"hello\n")):
        broken = tmp_path / f"{name}{suffix}"
        broken.write_bytes(content)
        with pytest.raises(MeshError) as caught:
            read_mesh(broken)
        one_line(caught, broken)


def test_a_face_that_names_no_vertex_is_an_error(tmp_path):
    path = tmp_path / "t.off"
    path.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n")
    with pytest.raises(MeshError) as caught:
        read_mesh(path)
    one_line(caught, path)
