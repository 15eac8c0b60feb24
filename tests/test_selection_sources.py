"""What holds of every source: stable orders from opposite ends, families on one side, and a union of several."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from graspfn import params
from graspfn.meshes.errors import MeshError
from graspfn.selection.candidate import Candidate, order
from graspfn.selection.procedural import CATEGORIES, Procedural
from graspfn.selection.sources import SOURCES, source_of
from graspfn.selection.union import Union

SEEDS = range(5)


class Boxes:
    """A finite source of boxes in four families."""

    def __init__(self, name, count):
        self.name, self.count = name, float(count)

    def candidates(self, split, seed, by):
        pool = [
            Candidate(f"{self.name}-{k}", self.name, str(k), "box", f"family {k % 4}", "")
            for k in range(int(self.count))
        ]
        yield from order(pool, split, seed, by)

    def load(self, candidate, rng):
        return trimesh.creation.box((1, 1, 1 + int(candidate.name)))


def union():
    return Union("both", [Boxes("small", 8), Boxes("large", 30)], Procedural())


def taken(source, split, seed, by, count=None):
    return list(itertools.islice(source.candidates(split, seed, by), count))


@pytest.mark.parametrize("seed", SEEDS)
def test_by_shape_the_splits_take_the_same_order_from_opposite_ends(seed):
    train, test = (taken(Boxes("a", 20), split, seed, "shape") for split in ("train", "test"))
    assert train == test[::-1]
    assert [candidate.name for candidate in train] != sorted(candidate.name for candidate in train)


def test_another_seed_is_another_order_and_another_deal_of_families():
    assert len({tuple(taken(Boxes("a", 20), "train", seed, "shape")) for seed in SEEDS}) == len(SEEDS)
    deals = {frozenset(c.family for c in taken(Boxes("a", 20), "train", seed, "family")) for seed in range(20)}
    assert len(deals) > 1


@pytest.mark.parametrize("seed", SEEDS)
def test_by_family_no_family_is_on_both_sides_and_none_is_lost(seed):
    train, test = (taken(Boxes("a", 20), split, seed, "family") for split in ("train", "test"))
    families = [{candidate.family for candidate in side} for side in (train, test)]
    assert families[0].isdisjoint(families[1])
    assert len(families[0]) == len(families[1]) == 2
    assert len(train) + len(test) == 20
    everything = taken(Boxes("a", 20), "train", seed, "shape")
    for side in (train, test):  # both forwards
        assert side == [candidate for candidate in everything if candidate in side]


def test_one_family_cannot_be_split():
    with pytest.raises(MeshError, match=r"^meshes\.split: family takes .* a has \['family 0'\] alone$"):
        taken(Boxes("a", 1), "train", 0, "family")


@pytest.mark.parametrize("seed", SEEDS)
def test_a_union_takes_all_of_the_finite_in_one_order_and_then_the_endless(seed):
    train, test = (taken(union(), split, seed, "shape", 86) for split in ("train", "test"))
    found = [[candidate for candidate in side if candidate.source != "procedural"] for side in (train, test)]
    assert len(found[0]) == 38
    assert found[0] == found[1][::-1]
    assert {candidate.source for candidate in found[0][:20]} == {"small", "large"}
    for source in union().finite:  # what the union draws of a source is in the source's own order
        assert [c for c in train if c.source == source.name] == taken(source, "train", seed, "shape")
    for side, split in ((train, "train"), (test, "test")):
        made = taken(Procedural(), split, seed, "shape", 48)
        assert side[1:76:2] == made[:38]
        assert side[76:] == made[38:]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_union_by_family_keeps_every_sources_families_apart(seed):
    sides = [taken(union(), split, seed, "family", 200) for split in ("train", "test")]
    families = [{(candidate.source, candidate.family) for candidate in side} for side in sides]
    assert families[0].isdisjoint(families[1])
    assert sum(candidate.source != "procedural" for side in sides for candidate in side) == 38


def test_a_union_loads_from_the_source_that_offered():
    source, rng = union(), np.random.default_rng(0)
    for candidate in taken(source, "train", 0, "shape", 42):
        mesh = source.load(candidate, rng)
        if candidate.source != "procedural":
            assert mesh.volume == pytest.approx(1 + int(candidate.name))


def test_every_choice_of_meshes_source_has_a_source():
    assert tuple(SOURCES) == params.SOURCES


@pytest.mark.parametrize(
    ("choice", "count"),
    [
        ("procedural", np.inf),
        ("open_objects", np.inf),
        ("rgb_objects", 152),
        ("random_urdfs", 1000),
        ("ycb", 78),
    ],
)
def test_sources_know_their_names_and_counts_before_they_fetch(choice, count, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    source = source_of(SimpleNamespace(source=choice))
    assert (source.name, source.count) == (choice, count)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("choice", ["folder", "modelnet40"])
def test_sources_of_files_read_meshes_folder(choice, tmp_path):
    path = tmp_path / "bed" / "train" / "bed_0001.off"
    path.parent.mkdir(parents=True)
    trimesh.creation.icosphere(1).export(path)
    source = source_of(SimpleNamespace(source=choice, folder=str(tmp_path)))
    (candidate,) = source.candidates("train", 0, "shape")
    assert (source.name, source.count, candidate.source, candidate.category) == (choice, 1, choice, "bed")


def test_procedural_families_are_its_categories():
    sides = [{c.family for c in taken(Procedural(), split, 0, "family", 100)} for split in ("train", "test")]
    assert sides[0].isdisjoint(sides[1])
    assert sides[0] | sides[1] == set(CATEGORIES)
