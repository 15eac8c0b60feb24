"""One mesh from one file: formats, OFF headers as found in the wild, and one clear line for what is damaged."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from graspfn.meshes.errors import MeshError, RejectedMeshError
from graspfn.selection.off import POINTS_NOTE
from graspfn.selection.reading import SUFFIXES, read_mesh

MODELNET = Path(__file__).parents[1] / "../shared/data/modelnet_off"
TETRAHEDRON = "4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
CUBE = "".join(f"{x:.1f} {y:.1f} {z:.1f}\n" for x in (0, 2) for y in (0, 2) for z in (0, 2))

needs_modelnet = pytest.mark.skipif(not MODELNET.is_dir(), reason="the ModelNet samples are not beside this checkout")


def write(path, content):
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def rejected(path, *words):
    with pytest.raises(RejectedMeshError) as caught:
        read_mesh(path)
    message = str(caught.value)
    assert "\n" not in message
    for word in (path, *words):
        assert str(word) in message


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_format_gives_the_same_solid(tmp_path, suffix):
    ball = trimesh.creation.icosphere(2)
    if suffix == ".gltf":
        for name, data in trimesh.exchange.gltf.export_gltf(ball.scene()).items():
            (tmp_path / name.replace("model", "ball")).write_bytes(data)
    else:
        ball.export(tmp_path / f"ball{suffix}")
    mesh = read_mesh(tmp_path / f"ball{suffix}")
    mesh.merge_vertices(merge_norm=True, merge_tex=True)
    assert mesh.volume == pytest.approx(ball.volume, rel=1e-5)


@pytest.mark.parametrize(
    "header", ["OFF\n", "OFF", "off\n", "", "OFF \n", "# by hand\nOFF # counts follow\n\n", "COFF\n"]
)
def test_off_headers_as_found_in_modelnet(tmp_path, header):
    mesh = read_mesh(write(tmp_path / "t.off", header + TETRAHEDRON))
    assert mesh.volume == pytest.approx(1 / 6)
    assert "source_note" not in mesh.metadata


@needs_modelnet
@pytest.mark.parametrize("path", sorted(MODELNET.glob("*.off")), ids=lambda path: path.stem)
def test_real_modelnet_files_hold_what_they_declare(path):
    mesh = read_mesh(path)
    if "no_header" in path.stem:
        assert mesh.metadata["source_note"] == POINTS_NOTE
        assert mesh.is_watertight
        points = np.loadtxt(path)
        assert np.array_equal(mesh.bounds, [points.min(axis=0), points.max(axis=0)])
    else:
        vertices, faces = map(int, path.read_text().removeprefix("OFF").split()[:2])
        assert len(mesh.vertices) == vertices
        assert len(mesh.faces) >= faces  # polygons come as several triangles


@needs_modelnet
def test_a_glued_header_changes_nothing():
    glued, plain = (read_mesh(MODELNET / f"bathtub_0002{suffix}.off") for suffix in ("_glued_header", ""))
    assert np.array_equal(glued.triangles, plain.triangles)


def test_a_bare_list_of_points_is_read_as_its_hull_and_says_so(tmp_path):
    mesh = read_mesh(write(tmp_path / "points.off", CUBE + "1.0 1.0 1.0\n"))
    assert mesh.volume == pytest.approx(8)
    assert mesh.metadata["source_note"] == POINTS_NOTE


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ("OFF\n8 0 0\n" + CUBE, "no faces"),  # points, but a header that says so
        ("8 0 0\n" + CUBE, "no faces"),
        ("0.0 0.0 0.0\n1.0 0.0 0.0\n0.0 1.0 0.0\n", "list of points"),  # too few
        (CUBE + "1.0 2.0\n", "list of points"),
        ("hello\n", "list of points"),
        ("OFF\nhello\n", "no counts"),
        ("OFF\n", "no counts"),
        ("# nothing\n", "list of points"),
        (f"OFF\n{TETRAHEDRON}".rpartition("3 1 2 3")[0], "4 vertices and 4 faces declared"),
        (f"OFF\n{TETRAHEDRON}".rpartition("2 3")[0], "cut short"),
        ("OFF\n4 4 0\n0 0 0\n1 0 0\n", "4 vertices and 4 faces declared"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "range"),
        ("", "empty"),
    ],
)
def test_an_off_file_that_is_not_whole_says_why(tmp_path, content, why):
    rejected(write(tmp_path / "t.off", content), why)


@pytest.mark.parametrize("suffix", [s for s in SUFFIXES if s != ".gltf"])
def test_a_file_cut_short_or_of_something_else_is_rejected(tmp_path, suffix):
    data = trimesh.creation.icosphere(1).export(file_type=suffix[1:])
    data = data.encode() if isinstance(data, str) else data
    cut = 200 if suffix == ".obj" else len(data) * 2 // 3  # an .obj may end at any line after its first face
    for name, content in (("cut", data[:cut]), ("text", b"hello\n"), ("empty", b"")):
        rejected(write(tmp_path / f"{name}{suffix}", content))


@pytest.mark.parametrize("kind", ["stl_ascii", "ply"])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_a_text_file_cut_between_lines_is_rejected(tmp_path, kind, share):
    options = {"encoding": "ascii"} if kind == "ply" else {}
    data = trimesh.creation.icosphere(1).export(file_type=kind, **options)
    lines = (data if isinstance(data, str) else data.decode()).splitlines(keepends=True)
    cut = "".join(lines[: int(share * len(lines))])
    rejected(write(tmp_path / f"cut.{kind[:3]}", cut))


def test_a_picture_that_is_missing_costs_no_mesh(tmp_path):
    text = trimesh.creation.icosphere(1).export(file_type="obj")
    mesh = read_mesh(write(tmp_path / "ball.obj", f"mtllib gone.mtl\nusemtl skin\n{text}"))
    assert len(mesh.faces) == 80


def test_a_missing_file_is_no_mere_reject(tmp_path):
    with pytest.raises(MeshError, match="no such file") as caught:
        read_mesh(tmp_path / "gone.off")
    assert not isinstance(caught.value, RejectedMeshError)


def test_a_directory_named_like_a_mesh_is_rejected(tmp_path):
    (tmp_path / "folder.off").mkdir()
    rejected(tmp_path / "folder.off", "cannot be read")
