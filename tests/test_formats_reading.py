"""One mesh from one file: formats, OFF headers as found in the wild, and one clear line for what is damaged."""

import codecs
import gzip
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from graspfn.formats.known import SUFFIXES
from graspfn.formats.off import POINTS_NOTE
from graspfn.formats.reading import parse_mesh, read_mesh
from graspfn.meshes.errors import MeshError, RejectedMeshError

ASCII = {".ply": {"encoding": "ascii"}}
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


def three_boxes(relative, corner, blocks):
    """An OBJ of boxes of a litre and of 18 cm side by side, their faces' indices counted from the start or back."""
    lines, so_far = ["vt 0 0", "vn 0 0 1"], 0
    for k, block in enumerate(blocks):
        box = trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation([0.2 * k, 0, 0])
        lines += [block, *(f"v {x} {y} {z}" for x, y, z in box.vertices.tolist())]
        so_far += len(box.vertices)
        for face in box.faces + 1 + so_far - len(box.vertices):
            lines.append("f " + " ".join(corner.format(v - 1 - so_far if relative else v) for v in face))
    return "\n".join([*lines, "v 9 9 9", ""]).encode()


@pytest.mark.parametrize("corner", ["{0}", "{0}/1", "{0}/-1", "{0}//1", "{0}/-1/-1"])
@pytest.mark.parametrize("blocks", [["o a", "o b", "o c"], ["g a", "", "g a"], ["usemtl a", "usemtl b", "s off"]])
def test_an_obj_with_relative_indices_is_the_one_with_absolute_ones(corner, blocks):
    relative, absolute = (parse_mesh(three_boxes(way, corner, blocks), "boxes.obj") for way in (True, False))
    assert np.array_equal(relative.triangles, absolute.triangles)
    assert relative.volume == pytest.approx(3e-3)
    assert relative.triangles[..., 0].max() == pytest.approx(0.45)


def test_an_obj_may_use_tabs_continued_lines_comments_and_windows_line_ends():
    vertices = "v\t0 0 0\r\nv 1 0 0 1.0\r\nv 0 1 \\\r\n 0\r\nv 0 0 1 0.5 0.5 0.5\r\n"
    text = vertices + "f 1 3 2 # base\r\nf -4 2 4\r\nf 1 4 3\r\nf 2 3 4"
    assert parse_mesh(text.encode(), "t.obj").volume == pytest.approx(1 / 6)


@pytest.mark.parametrize("face", ["f 1 2 5", "f 1 2 -5", "f 0 1 2", "f 1 2 x"])
def test_an_obj_that_names_no_vertex_is_rejected(tmp_path, face):
    rejected(write(tmp_path / "t.obj", f"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n{face}\n"), "cannot be read as .obj")


STAR = np.array([[r * np.cos(t), r * np.sin(t)] for r, t in zip([1, 0.3] * 5, np.arange(10) * np.pi / 5, strict=True)])
DART = np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 0.3], [-1.0, 1.0]])  # a quad that one of its diagonals leaves


def prism(outline, turn):
    """(vertices, polygons) of an upright column over an outline, tilted; each polygon starts `turn` corners on."""
    k = len(outline)
    vertices = np.vstack([np.column_stack([outline, np.full(k, z)]) for z in (0, 1)])
    tilt = trimesh.transformations.rotation_matrix(1.0, [1, 2, 3])[:3, :3]
    ring = np.arange(k)
    sides = [[i, (i + 1) % k, (i + 1) % k + k, i + k] for i in ring]
    return vertices @ tilt.T, [list(np.roll(face, turn)) for face in [ring[::-1], ring + k, *sides]]


def text_of(suffix, vertices, polygons):
    points = [" ".join(map(repr, vertex)) for vertex in vertices.tolist()]
    if suffix == ".obj":
        faces = ["f " + " ".join(str(v + 1) for v in polygon) for polygon in polygons]
        return "\n".join([*(f"v {point}" for point in points), *faces, ""]).encode()
    faces = [f"{len(polygon)} " + " ".join(map(str, polygon)) for polygon in polygons]
    if suffix == ".off":
        return "\n".join(["OFF", f"{len(points)} {len(faces)} 0", *points, *faces, ""]).encode()
    return ply_header("ascii", len(points), len(faces)) + "\n".join([*points, *faces, ""]).encode()


def ply_header(form, points, faces, more=""):
    properties = "".join(f"property double {axis}\n" for axis in "xyz")
    lines = f"ply\nformat {form} 1.0\nelement vertex {points}\n{properties}{more}element face {faces}\n"
    return f"{lines}property list uchar int vertex_indices\nend_header\n".encode()


def binary_ply(order, vertices, polygons):
    """A binary PLY, of either byte order."""
    data = ply_header("binary_" + ("little" if order == "<" else "big") + "_endian", len(vertices), len(polygons))
    data += vertices.astype(f"{order}f8").tobytes()
    for polygon in polygons:
        data += bytes([len(polygon)]) + np.array(polygon, f"{order}i4").tobytes()
    return data


@pytest.mark.parametrize("form", [".off", ".obj", ".ply", "<", ">"])
@pytest.mark.parametrize("outline", [STAR, DART], ids=["star", "dart"])
@pytest.mark.parametrize("turn", range(4))
def test_polygons_of_any_shape_are_taken_whole(form, outline, turn):
    """Neither a fan from one corner nor a diagonal: what is outside an outline stays outside."""
    vertices, polygons = prism(outline, turn)
    data = text_of(form, vertices, polygons) if form[0] == "." else binary_ply(form, vertices, polygons)
    mesh = parse_mesh(data, f"prism{form if form[0] == '.' else '.ply'}")
    area = abs(np.sum(outline[:, 0] * np.roll(outline[:, 1], -1) - outline[:, 1] * np.roll(outline[:, 0], -1))) / 2
    around = np.linalg.norm(outline - np.roll(outline, -1, axis=0), axis=1).sum()
    assert np.array_equal(mesh.vertices, vertices)
    assert mesh.is_volume
    assert mesh.volume == pytest.approx(area)
    assert mesh.area == pytest.approx(2 * area + around)  # nothing is there twice


@pytest.mark.parametrize("mark", [codecs.BOM_UTF8, "utf-16-le", "utf-16-be", "utf-32-le"])
@pytest.mark.parametrize("suffix", [".off", ".obj", ".stl", ".ply", ".gltf"])
def test_a_byte_order_mark_changes_nothing(suffix, mark):
    ball = trimesh.creation.icosphere(1)
    if suffix == ".gltf":
        data = trimesh.exchange.gltf.export_gltf(ball.scene(), embed_buffers=True)["model.gltf"]
    else:
        data = ball.export(file_type={".stl": "stl_ascii"}.get(suffix, suffix[1:]), **ASCII.get(suffix, {}))
    text = data if isinstance(data, str) else data.decode()
    marked = mark + text.encode() if isinstance(mark, bytes) else ("\ufeff" + text).encode(mark)
    assert np.array_equal(parse_mesh(marked, f"b{suffix}").triangles, parse_mesh(text.encode(), f"b{suffix}").triangles)


@pytest.mark.parametrize("cut", [0, 1])
def test_a_ply_is_whole_that_holds_what_it_declares(tmp_path, cut):
    """Vertices that no face uses, texture coordinates that differ where faces meet, elements of other kinds."""
    ball = trimesh.creation.icosphere(1)
    unused = 7
    vertices = np.vstack([ball.vertices, np.full((unused, 3), 5.0)])
    lines = ["ply", "format ascii 1.0", "comment TextureFile gone.png", f"element vertex {len(vertices)}"]
    lines += [f"property float {axis}" for axis in "xyz"] + ["element face 80"]
    lines += ["property list uchar int vertex_indices", "property list uchar float texcoord"]
    lines += ["element edge 1", "property int vertex1", "property int vertex2", "end_header"]
    lines += [" ".join(map(str, vertex)) for vertex in vertices.tolist()]
    lines += [f"3 {a} {b} {c} 6 0 0 1 {k / 80} 0 1" for k, (a, b, c) in enumerate(ball.faces)] + ["0 1"]
    path = write(tmp_path / "ball.ply", "\n".join(lines[: len(lines) - cut]) + "\n")
    if cut:
        rejected(path, "cut short: 0 of 1 edge lines")
    else:
        mesh = read_mesh(path)
        assert np.array_equal(mesh.vertices, vertices)
        assert np.array_equal(mesh.faces, ball.faces)


def test_a_text_ply_of_quads_that_lacks_half_of_them_is_cut_short(tmp_path):
    """Though it has as many triangles as it should have quads."""
    vertices, polygons = prism(DART[[0, 1, 3]], 0)
    data = text_of(".ply", vertices, [polygons[2]] * 6).splitlines(keepends=True)
    rejected(write(tmp_path / "cut.ply", b"".join(data[:-3])), "cut short: 3 of 6 face lines")


@pytest.mark.parametrize("suffix", [".off", ".obj", ".ply"])
def test_a_cloud_of_points_is_called_so(tmp_path, suffix):
    rejected(write(tmp_path / f"cloud{suffix}", text_of(suffix, np.eye(4)[:, :3], [])), "4 points and no faces")


def archive():
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as zipped:
        zipped.writestr("ball.obj", "v 0 0 0")
    return data.getvalue()


OTHERS = {
    "an HTML page": b"\n<!DOCTYPE html>\n<html><body>404</body></html>",
    "a Git LFS pointer": b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n",
    "gzip data": gzip.compress(b"v 0 0 0\n"),
    "a zip archive": archive(),
    "JSON, as a server answers": b'{"message": "Not Found", "status": "404"}',
    "a picture": b"\x89PNG\r\n\x1a\n" + bytes(100),
}


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("what", OTHERS)
def test_what_is_no_mesh_is_called_what_it_is(tmp_path, suffix, what):
    rejected(write(tmp_path / f"mug{suffix}", OTHERS[what]), what)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("kind", ["ply", "stl_ascii", "glb", "gltf", "off"])
def test_a_mesh_under_the_name_of_another_format_is_told_its_own(tmp_path, suffix, kind):
    ball = trimesh.creation.icosphere(1)
    if kind == "gltf":
        data = trimesh.exchange.gltf.export_gltf(ball.scene(), embed_buffers=True)["model.gltf"]
    else:
        data = ball.export(file_type=kind)
    if suffix != f".{kind[:3]}" and suffix != f".{kind}":
        rejected(write(tmp_path / f"ball{suffix}", data), f"name it .{kind.partition('_')[0]}")


@pytest.mark.parametrize("name", ["robot.urdf", "mug.dae", "mug.3mf", "mug"])
def test_a_format_that_is_not_read_is_answered_with_those_that_are(tmp_path, name):
    rejected(write(tmp_path / name, "<robot/>"), "is not read", *SUFFIXES)


def test_a_name_that_is_no_utf8_is_told_in_a_line_that_can_be_printed(tmp_path):
    with pytest.raises(RejectedMeshError) as caught:
        read_mesh(write(tmp_path / "caf\udce9.off", "hello"))
    assert "caf\\udce9.off" in str(caught.value).encode().decode()
