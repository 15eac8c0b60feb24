"""Procedural objects are closed solids in one piece, varied, and functions of their generator alone."""

import itertools

import numpy as np
import pytest

from graspfn.meshes.errors import RejectedMeshError
from graspfn.seeds import generator
from graspfn.selection.primitives import box, to_trimesh
from graspfn.selection.procedural import CATEGORIES, Procedural, generate
from graspfn.selection.signature import Shapes, signature
from graspfn.selection.trained import Trained

DRAWS = 4
MODELNET40 = """airplane bathtub bed bench bookshelf bottle bowl car chair cone cup curtain desk door dresser flower_pot
    glass_box guitar keyboard lamp laptop mantel monitor night_stand person piano plant radio range_hood sink sofa
    stairs stool table tent toilet tv_stand vase wardrobe xbox"""


def test_the_classes_are_those_of_modelnet40_and_two_that_the_paper_shows():
    assert list(CATEGORIES) == sorted([*MODELNET40.split(), "dish", "hammer"])


def draws(category):
    return [generate(category, generator(0, "test", category, k)) for k in range(DRAWS)]


@pytest.mark.parametrize("category", CATEGORIES)
def test_closed_solid_in_one_piece_with_modest_faces(category):
    for mesh in draws(category):
        assert mesh.is_volume
        assert mesh.body_count == 1
        assert mesh.volume > 0
        assert 30 < len(mesh.faces) < 2500


@pytest.mark.parametrize("category", CATEGORIES)
def test_same_generator_same_object_and_other_generators_other_shapes(category):
    """At most two of four are of one shape."""
    first, *_ = meshes = draws(category)
    again = generate(category, generator(0, "test", category, 0))
    assert np.array_equal(first.vertices, again.vertices)
    assert np.array_equal(first.faces, again.faces)
    shapes = Shapes()
    for k, mesh in enumerate(meshes):
        if shapes.like(signature(mesh)) is None:
            shapes.add(str(k), signature(mesh))
    assert len(shapes.ids) >= DRAWS - 1


@pytest.mark.parametrize("category", ["cone", "dish", "guitar", "hammer", "keyboard", "piano"])
def test_classes_of_few_proportions_do_not_run_dry(category):
    """Of twenty objects at most two are nearly one other of their class: test objects that are go out."""
    made = [generate(category, generator(0, "dry", category, k)) for k in range(21)]
    trained = Trained()
    trained.add("one", signature(made[0]), made[0])
    assert sum(trained.nearest(signature(mesh), mesh).same for mesh in made[1:]) <= 2


def test_what_is_in_pieces_is_turned_down():
    """A generator may leave a gap: of seed 1, plants 4 and 5. It would end the stage."""
    with pytest.raises(RejectedMeshError, match="its parts do not touch"):
        to_trimesh(box((1, 1, 1)) + box((1, 1, 1), (2, 0, 0)))


@pytest.mark.parametrize("category", CATEGORIES)
def test_walls_are_thick_enough_for_physics(category):
    """Nine in ten points of the surface have 3% of the size of material behind them (edges taper)."""
    for mesh in draws(category):
        size = mesh.extents.max()
        points, face = mesh.sample(300, return_index=True, seed=0)
        inwards = -mesh.face_normals[face]
        hits, ray, _ = mesh.ray.intersects_location(points + 1e-4 * size * inwards, inwards, multiple_hits=False)
        thickness = np.linalg.norm(hits - points[ray], axis=1)
        assert np.quantile(thickness, 0.1) > 0.03 * size


@pytest.mark.parametrize("category", ["bowl", "cup", "dish", "vase", "bathtub"])
def test_vessels_are_hollow(category):
    for mesh in draws(category):
        assert mesh.volume < 0.6 * mesh.convex_hull.volume


@pytest.mark.parametrize("category", CATEGORIES)
def test_hardly_any_needles_among_the_faces(category):
    """Triangles without an altitude have no normal that a contact could use."""
    altitudes = []
    for mesh in draws(category):
        longest = np.linalg.norm(mesh.triangles - np.roll(mesh.triangles, 1, axis=1), axis=2).max(axis=1)
        altitudes.append(2 * mesh.area_faces / longest / mesh.extents.max())
    assert np.mean(np.concatenate(altitudes) < 1e-5) < 0.005


def test_training_objects_are_the_even_ones_test_objects_the_odd_and_every_category_comes_round():
    turn = len(CATEGORIES)
    for split, numbers in (("train", {0, 2}), ("test", {1, 3})):
        found = list(itertools.islice(Procedural().candidates(split, 0, "shape"), 2 * turn))
        assert {int(candidate.name.rpartition("-")[2]) for candidate in found} == numbers
        assert [candidate.category for candidate in found] == [*CATEGORIES, *CATEGORIES]
        assert {candidate.id for candidate in found} == {f"procedural-{candidate.name}" for candidate in found}
        assert {candidate.licence for candidate in found} == {"MIT"}


def test_a_candidate_loads_as_what_its_category_generates():
    (candidate,) = itertools.islice(Procedural().candidates("test", 0, "shape"), 3, 4)
    mesh = Procedural().load(candidate, generator(0, candidate.id))
    assert np.array_equal(mesh.triangles, generate(candidate.category, generator(0, candidate.id)).triangles)
