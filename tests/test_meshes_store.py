"""Objects survive the disk: shapes to float32, rows exactly, equal bytes for equal objects; damage is named."""

import numpy as np
import pytest
import trimesh

from graspfn.meshes.errors import MeshError
from graspfn.meshes.store import MANIFEST, load_object, read_manifest
from graspfn.params import Meshes
from graspfn.selection.selection import select
from graspfn.selection.written import COLUMNS, Object, write_objects

MESHES = Meshes(
    source="procedural",
    folder="",
    split="shape",
    train=4,
    test=1,
    size_min_cm=5.0,
    size_max_cm=20.0,
    collision_faces=100,
    collision_tolerance_mm=2.0,
)


@pytest.fixture(scope="module")
def objects():
    return list(select(MESHES, 0).train)


def write(folder, objects):
    return write_objects(folder / "objects", folder / "collision", objects)


def test_round_trip(tmp_path, objects):
    write(tmp_path, iter(objects))
    manifest = read_manifest(tmp_path / "objects")
    assert list(manifest.columns) == list(COLUMNS)
    assert manifest["id"].is_monotonic_increasing
    rows = manifest.set_index("id", drop=False).to_dict("index")
    for drawn in objects:
        name = drawn.row["id"]
        stored = rows[name] | {"signature": list(rows[name]["signature"])}
        assert np.isnan(stored.pop("nearest_distance"))  # of an object to train on
        assert stored == {key: value for key, value in drawn.row.items() if key != "nearest_distance"}
        for folder, mesh in (("objects", drawn.mesh), ("collision", drawn.collision)):
            stored = load_object(tmp_path / folder, name)
            assert np.array_equal(stored.faces, mesh.faces)
            np.testing.assert_allclose(stored.vertices, mesh.vertices, atol=1e-8)
        stored = load_object(tmp_path / "objects", name)
        assert stored.is_volume
        assert stored.volume == pytest.approx(drawn.row["volume_m3"], rel=1e-5)


def test_equal_objects_give_equal_bytes_whatever_was_there_before(tmp_path, objects):
    write(tmp_path / "a", objects)
    write(tmp_path / "b", objects[:1])
    for folder in ("objects", "collision"):
        (tmp_path / "b" / folder / "old.ply").write_bytes(b"of an earlier run")
    write(tmp_path / "b", objects[::-1])
    contents = [
        {path.relative_to(tmp_path / run): path.read_bytes() for path in (tmp_path / run).rglob("*.*")} for run in "ab"
    ]
    assert contents[0] == contents[1]
    assert {path.name for path in contents[0]} == {MANIFEST, *(f"{drawn.row['id']}.ply" for drawn in objects)}


def test_objects_are_written_one_by_one(tmp_path, objects):
    def watched():
        for count, drawn in enumerate(objects):
            assert len(list((tmp_path / "objects").glob("*.ply"))) == count
            yield drawn

    assert len(write(tmp_path, watched())) == len(objects)


def test_cached_normals_do_not_reach_the_file(tmp_path, objects):
    drawn = objects[0]
    write(tmp_path / "bare", [drawn])
    used = trimesh.Trimesh(drawn.mesh.vertices, drawn.mesh.faces, process=False)
    assert used.vertex_normals.shape == used.vertices.shape  # cached on the mesh from here on
    write(tmp_path / "used", [Object(drawn.row, used, drawn.collision)])
    name = f"objects/{drawn.row['id']}.ply"
    assert (tmp_path / "bare" / name).read_bytes() == (tmp_path / "used" / name).read_bytes()


def test_damage_is_one_line_with_the_file(tmp_path, objects):
    write(tmp_path, objects[:1])
    name = objects[0].row["id"]
    path = tmp_path / "objects" / f"{name}.ply"
    data = path.read_bytes()
    for end in (0, 7, 150, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:end])
        with pytest.raises(MeshError) as caught:
            load_object(tmp_path / "objects", name)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
    with pytest.raises(MeshError, match="no such file"):
        load_object(tmp_path, "nobody")


def test_missing_and_damaged_manifest(tmp_path, objects):
    with pytest.raises(MeshError, match="select_meshes"):
        read_manifest(tmp_path)
    write(tmp_path, objects[:1])
    path = tmp_path / "objects" / MANIFEST
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(MeshError, match="select_meshes") as caught:
        read_manifest(tmp_path / "objects")
    assert "\n" not in str(caught.value)
