"""Objects survive the disk: shapes to float32, rows exactly, equal bytes for equal objects; damage is named."""

import numpy as np
import pytest
import trimesh

from graspfn.meshes.errors import MeshError
from graspfn.meshes.selection import select
from graspfn.meshes.store import COLUMNS, MANIFEST, load_object, read_manifest, write_objects
from graspfn.params import Meshes

MESHES = Meshes(source="procedural", folder=None, train=4, test=1, size_min_cm=5.0, size_max_cm=20.0)


@pytest.fixture(scope="module")
def objects():
    return list(select(MESHES, 0).train)


def test_round_trip(tmp_path, objects):
    write_objects(tmp_path, iter(objects))
    manifest = read_manifest(tmp_path)
    assert list(manifest.columns) == list(COLUMNS)
    assert manifest["id"].is_monotonic_increasing
    rows = manifest.set_index("id", drop=False).to_dict("index")
    for row, mesh in objects:
        assert rows[row["id"]] == row
        stored = load_object(tmp_path, row["id"])
        assert np.array_equal(stored.faces, mesh.faces)
        np.testing.assert_allclose(stored.vertices, mesh.vertices, atol=1e-8)
        assert stored.is_volume
        assert stored.volume == pytest.approx(row["volume_m3"], rel=1e-5)


def test_equal_objects_give_equal_bytes_whatever_was_there_before(tmp_path, objects):
    folders = [tmp_path / "a", tmp_path / "b"]
    write_objects(folders[0], objects)
    write_objects(folders[1], [objects[0]])
    (folders[1] / "old.ply").write_bytes(b"of an earlier run")
    write_objects(folders[1], objects[::-1])
    contents = [{path.name: path.read_bytes() for path in folder.iterdir()} for folder in folders]
    assert contents[0] == contents[1]
    assert set(contents[0]) == {MANIFEST, *(f"{row['id']}.ply" for row, _ in objects)}


def test_objects_are_written_one_by_one(tmp_path, objects):
    def watched():
        for count, pair in enumerate(objects):
            assert len(list(tmp_path.glob("*.ply"))) == count
            yield pair

    assert len(write_objects(tmp_path, watched())) == len(objects)


def test_cached_normals_do_not_reach_the_file(tmp_path, objects):
    row, mesh = objects[0]
    write_objects(tmp_path / "bare", [(row, mesh)])
    used = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert used.vertex_normals.shape == used.vertices.shape  # cached on the mesh from here on
    write_objects(tmp_path / "used", [(row, used)])
    name = f"{row['id']}.ply"
    assert (tmp_path / "bare" / name).read_bytes() == (tmp_path / "used" / name).read_bytes()


def test_damage_is_one_line_with_the_file(tmp_path, objects):
    row, mesh = objects[0]
    write_objects(tmp_path, [(row, mesh)])
    path = tmp_path / f"{row['id']}.ply"
    data = path.read_bytes()
    for end in (0, 7, 150, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:end])
        with pytest.raises(MeshError) as caught:
            load_object(tmp_path, row["id"])
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
    with pytest.raises(MeshError, match="no such file"):
        load_object(tmp_path, "nobody")


def test_missing_and_damaged_manifest(tmp_path, objects):
    with pytest.raises(MeshError, match="select_meshes"):
        read_manifest(tmp_path)
    write_objects(tmp_path, objects[:1])
    (tmp_path / MANIFEST).write_bytes((tmp_path / MANIFEST).read_bytes()[:100])
    with pytest.raises(MeshError, match="select_meshes") as caught:
        read_manifest(tmp_path)
    assert "\n" not in str(caught.value)
