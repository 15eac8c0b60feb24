"""The split: sizes in range, no shape on both sides, and object i the same whatever the counts or the workers."""

import collections
import functools
import itertools
import os
import re
import signal

import numpy as np
import pytest
import trimesh

from graspfn.meshes.errors import MeshError
from graspfn.meshes.mass import solid
from graspfn.params import Compute, Meshes
from graspfn.selection import surfaces, trained
from graspfn.selection.procedural import CATEGORIES, generate
from graspfn.selection.selection import one_by_one, select
from graspfn.selection.signature import TOLERANCE
from graspfn.workflow.parallel import map_in_order


def meshes(source, train, test, folder="", split="shape"):
    return Meshes(
        source=source,
        folder=str(folder),
        split=split,
        train=train,
        test=test,
        size_min_cm=5.0,
        size_max_cm=20.0,
        collision_faces=100,
        collision_tolerance_mm=2.0,
    )


def rows(objects):
    return [drawn.row for drawn in objects]


def ids(objects):
    return [row["id"] for row in rows(objects)]


@pytest.fixture
def shapes(tmp_path):
    """Twelve different closed boxes in files of two classes."""
    for k in range(12):
        path = tmp_path / ("a", "b")[k % 2] / "train" / f"box_{k}.off"
        path.parent.mkdir(parents=True, exist_ok=True)
        box = trimesh.creation.box((1, 1.25**k, 3)).apply_translation([50, k, -7])
        path.write_text(box.export(file_type="off", digits=12))
    return tmp_path


def test_row_describes_a_mesh_that_is_scaled_and_centred_on_its_mass():
    for drawn in select(meshes("procedural", len(CATEGORIES), 1), seed=0).train:
        row, mesh = drawn.row, drawn.mesh
        assert 0.05 <= row["size_m"] <= 0.20
        assert row["size_m"] == pytest.approx(mesh.extents.max())
        np.testing.assert_allclose(mesh.center_mass, 0, atol=1e-9)
        assert row["volume_m3"] == pytest.approx(mesh.volume)
        assert row["watertight"]
        assert (row["faces"], row["collision_faces"]) == (len(mesh.faces), len(drawn.collision.faces))
        assert row["id"] == f"procedural-{row['name']}"
        assert (row["split"], row["mass"], row["cleaning"]) == ("train", "volume", "")


def test_sizes_are_uniform(shapes):
    """Over many seeds the mean and spread are those of the uniform distribution on [5, 20] cm."""
    sizes = [row["size_m"] for seed in range(25) for row in rows(select(meshes("folder", 6, 6, shapes), seed).train)]
    assert np.mean(sizes) == pytest.approx(0.125, abs=4 * 0.15 / np.sqrt(12 * len(sizes)))
    assert np.std(sizes) == pytest.approx(0.15 / np.sqrt(12), rel=0.15)


@pytest.mark.parametrize("counts", [(1, 1), (20, 3), (36, 36)])
def test_categories_are_equally_frequent_and_splits_disjoint(counts):
    chosen = select(meshes("procedural", *counts), seed=1)
    drawn = {split: rows(getattr(chosen, split)) for split in ("train", "test")}
    for split, wanted in zip(("train", "test"), counts, strict=True):
        assert len({row["id"] for row in drawn[split]}) == wanted
        frequency = collections.Counter(row["class"] for row in drawn[split])
        assert max(frequency.values()) - min(frequency[c] for c in CATEGORIES) <= 1
    assert not {row["id"] for row in drawn["train"]} & {row["id"] for row in drawn["test"]}


def copies(mesh, count, rng):
    """The mesh scaled, mirrored, turned, moved and subdivided."""
    for k in range(count):
        T = trimesh.transformations.random_rotation_matrix(rand=rng.random(3))[:3, :3] * rng.uniform(0.1, 10)
        copy = mesh.subdivide() if k % 2 else mesh
        vertices = (copy.vertices * [(-1) ** (k // 2), 1, 1]) @ T.T + rng.normal(size=3)
        yield trimesh.Trimesh(vertices, copy.faces, process=False)


@pytest.mark.parametrize("seed", range(4))
def test_copies_of_a_shape_fall_on_one_side(tmp_path, seed):
    rng = np.random.default_rng(seed)
    for name in list(CATEGORIES)[:7]:
        for k, copy in enumerate(copies(generate(name, np.random.default_rng(7)), 4, rng)):
            copy.export(tmp_path / f"{name}_{k}.ply")
    chosen = select(meshes("folder", 6, 4, tmp_path), seed)
    train, test = rows(chosen.train), rows(chosen.test)
    assert not {row["name"].rpartition("_")[0] for row in train} & {row["name"].rpartition("_")[0] for row in test}
    gap = np.abs(np.array([r["signature"] for r in train])[:, None] - [r["signature"] for r in test]).max(axis=2)
    assert gap.min() >= TOLERANCE
    for split in (train, test):
        for one, other in itertools.combinations(split, 2):
            same = one["name"].rpartition("_")[0] == other["name"].rpartition("_")[0]
            assert (one["shape"] == other["shape"]) == same
    assert any("copy: " in reject["reason"] for reject in chosen.rejects)


def test_no_generated_test_object_is_nearly_one_to_train_on():
    """All pairs are looked at anew."""
    chosen = select(meshes("procedural", 28, 28), 0)
    train, test = list(chosen.train), list(chosen.test)
    shapes = [surfaces.surface_of(drawn.mesh) for drawn in train]
    for drawn in test:
        apart = np.abs(np.array([one.row["signature"] for one in train]) - drawn.row["signature"]).max(axis=1)
        near = np.flatnonzero(apart < trained.NEAR) if apart.min() < trained.NEAR else [apart.argmin()]
        surface = surfaces.surface_of(drawn.mesh)
        gaps = [surfaces.gap(surface, shapes[k]) for k in near]
        assert min(gaps) >= trained.TOLERANCE
        assert drawn.row["nearest"] == train[near[np.argmin(gaps)]].row["id"]
        assert drawn.row["nearest_distance"] == pytest.approx(min(gaps), abs=1e-5)
    assert all(drawn.row["nearest"] == "" and np.isnan(drawn.row["nearest_distance"]) for drawn in train)


def test_a_near_copy_that_its_signature_does_not_give_away_stays_out_of_the_test_objects(tmp_path):
    """Six boxes, and each again 2 % wider."""
    for k, wide in itertools.product(range(6), (1, 1.02)):
        box = trimesh.creation.box([wide, 2 + k, 3])
        (tmp_path / f"{k}_{wide}.off").write_text(box.export(file_type="off", digits=12))
    chosen = select(meshes("folder", 6, 2, tmp_path), 0)
    train, test = ({row["name"][0] for row in rows(objects)} for objects in (chosen.train, chosen.test))
    assert not train & test
    assert chosen.rejects
    line = re.compile(
        r"copy: it has the shape of \S+, which is to train on \(surfaces 0\.[0-3]\d % of its size apart\)"
    )
    assert all(line.fullmatch(reject["reason"]) for reject in chosen.rejects)


def test_larger_counts_begin_with_the_same_objects(shapes):
    for few, many in (
        (meshes("procedural", 5, 3), meshes("procedural", 9, 6)),
        (meshes("folder", 2, 3, shapes), meshes("folder", 6, 6, shapes)),
    ):
        for split in ("train", "test"):
            small, large = getattr(select(few, 4), split), getattr(select(many, 4), split)
            for one, same in itertools.islice(zip(small, large, strict=False), 3):
                assert one.row == same.row
                assert np.array_equal(one.mesh.vertices, same.mesh.vertices)


def test_another_seed_is_another_draw(shapes):
    assert ids(select(meshes("folder", 6, 1, shapes), 0).train) != ids(select(meshes("folder", 6, 1, shapes), 1).train)
    one, other = (next(select(meshes("procedural", 1, 1), seed).train) for seed in (0, 1))
    assert one.row["id"] == other.row["id"]
    assert one.mesh.volume != pytest.approx(other.mesh.volume)


def test_folder_can_be_used_up_and_no_further(shapes):
    chosen = select(meshes("folder", 7, 5, shapes), 0)
    names = ids(chosen.train) + ids(chosen.test)
    assert len(set(names)) == 12
    assert all(name.startswith("folder-box_") for name in names)
    with pytest.raises(MeshError, match="not enough meshes") as caught:
        select(meshes("folder", 7, 6, shapes), 0)
    assert str(shapes) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unfit_meshes_are_replaced_and_recorded(shapes):
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2], [0, 1, 3], [0, 3, 2]])
    for k in range(3):
        (shapes / f"sheet_{k}.off").write_text(sheet.export(file_type="off"))
    (shapes / "cut.off").write_bytes((shapes / "a" / "train" / "box_0.off").read_bytes()[:80])
    (shapes / "empty.off").touch()
    chosen = select(meshes("folder", 6, 6, shapes), 0)
    names = ids(chosen.train) + ids(chosen.test)
    assert len(set(names)) == 12
    assert len(chosen.rejects) >= 1
    for reject in chosen.rejects:
        reason = "no volume: " if "sheet" in reject["name"] else "unreadable: "
        assert reject["reason"].startswith(reason)
        assert reject["name"] in {"sheet_0.off", "sheet_1.off", "sheet_2.off", "cut.off", "empty.off"}
    chosen = select(meshes("folder", 8, 8, shapes), 0)
    with pytest.raises(MeshError, match="5 rejected"):
        list(chosen.train), list(chosen.test)


def test_open_mesh_is_centred_on_its_hull(tmp_path):
    for k in range(2):
        box = trimesh.creation.box((1, 2, 3 + k)).subdivide()
        opened = trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 2] < 0.5], process=False)
        opened.apply_translation([0, 9, 0]).export(tmp_path / f"tub_{k}.off")
    for drawn in select(meshes("folder", 1, 1, tmp_path), 0).train:
        assert drawn.row["mass"] == "convex hull"
        assert not drawn.row["watertight"]
        np.testing.assert_allclose(solid(drawn.mesh).center_mass, 0, atol=1e-9)
        assert drawn.row["volume_m3"] == pytest.approx(drawn.mesh.convex_hull.volume)
        assert drawn.row["class"] == ""


def test_families_fall_on_one_side(shapes):
    chosen = select(meshes("folder", 6, 6, shapes, split="family"), 0)
    sides = [{row["family"] for row in rows(objects)} for objects in (chosen.train, chosen.test)]
    assert sorted(map(list, sides)) == [["a"], ["b"]]


def test_the_number_of_workers_changes_nothing(shapes):
    (shapes / "empty.off").touch()
    wanted = meshes("folder", 5, 4, shapes)
    compute = Compute(address=None, workers=2, device="cpu", checkpoint_s=60.0, loaders=0)
    alone, spread = select(wanted, 3), select(wanted, 3, functools.partial(map_in_order, compute=compute, label="test"))
    for split in ("train", "test"):
        for one, same in zip(getattr(alone, split), getattr(spread, split), strict=True):
            assert one.row == same.row
            for a, b in ((one.mesh, same.mesh), (one.collision, same.collision)):
                assert np.array_equal(a.vertices, b.vertices)
                assert np.array_equal(a.faces, b.faces)
    assert alone.rejects == spread.rejects


def kill_or_make(how, make, candidate, *arguments):
    """Stands for a native library that one of the meshes takes down, and its process with it."""
    if candidate.name.endswith("box_10.off"):
        if how == "kill":
            os.kill(os.getpid(), signal.SIGSEGV)
        raise RuntimeError(f"{candidate.id}: killed its worker process 3 times")
    return make(candidate, *arguments)


def test_a_mesh_that_kills_its_worker_is_turned_down_and_no_other(shapes):
    """Nor does anything else change, whatever ran beside it."""
    wanted, found = meshes("folder", 5, 4, shapes), []
    for workers in (0, 1, 3):
        compute = Compute(address=None, workers=workers, device="cpu", checkpoint_s=60.0, loaders=0)
        over = functools.partial(map_in_order, compute=compute, label="test") if workers else one_by_one
        how = "kill" if workers else "raise"

        def made(make, tasks, count, over=over, how=how):
            return over(functools.partial(kill_or_make, how, make), tasks, count)

        selection = select(wanted, 3, made)
        found.append((ids(selection.train), ids(selection.test), selection.rejects))
    assert found[0] == found[1] == found[2]
    assert [reject["name"].rpartition("/")[2] for reject in found[0][2]] == ["box_10.off"]


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (ArithmeticError("no luck"), "turned down in a row: failed: ArithmeticError no luck"),
        # a worker without the package is no reason to reject
        (ModuleNotFoundError("No module named 'manifold3d'"), "every worker takes this package"),
    ],
)
def test_an_endless_source_of_failures_ends(monkeypatch, error, line):
    def fail(*arguments):
        raise error

    monkeypatch.setattr("graspfn.selection.selection.make_object", fail)
    with pytest.raises(MeshError, match=line):
        list(select(meshes("procedural", 3, 1), 0).train)


def test_too_few_of_one_split_are_missed_at_once(shapes):
    for path in shapes.rglob("*.off"):  # ModelNet's layout, all of it to train on
        path.rename(path.with_name(f"{path.parent.parent.name}_{path.name}"))
    with pytest.raises(MeshError, match="0 to test on"):
        select(meshes("modelnet40", 2, 2, shapes), 0)


def test_two_meshes_cannot_have_one_id(tmp_path):
    for name in ("bed#0", "bed+0"):
        path = tmp_path / "bed" / "train" / f"{name}.off"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(trimesh.creation.box().export(file_type="off"))
    with pytest.raises(MeshError, match="would both be modelnet40-bed_0"):
        select(meshes("modelnet40", 1, 1, tmp_path), 0)
