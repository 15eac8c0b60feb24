"""Surfaces laid on each other: nothing between copies, something between shapes whose signatures are near."""

import numpy as np
import pytest
import trimesh

from graspfn.selection.procedural import CATEGORIES, generate
from graspfn.selection.signature import Shapes, signature
from graspfn.selection.surfaces import gap, surface_of
from graspfn.selection.trained import NEAR, TOLERANCE, Trained

BALL = trimesh.creation.icosphere(4)
BOTTLE = generate("bottle", np.random.default_rng(3))


def apart(a, b):
    return gap(surface_of(a), surface_of(b))


def signatures_apart(a, b):
    return np.abs(signature(a) - signature(b)).max()


def copy_of(mesh, rng):
    """The mesh scaled by up to 50, mirrored, turned, moved and subdivided."""
    fine = mesh.subdivide()
    T = trimesh.transformations.random_rotation_matrix(rand=rng.random(3))[:3, :3] * rng.uniform(0.02, 50)
    return trimesh.Trimesh(fine.vertices * [-1, 1, 1] @ T.T + rng.normal(size=3), fine.faces[:, ::-1], process=False)


def dented(ball, depth):
    """A ball, flattened from above where it is highest, like an apple."""
    height = ball.vertices[:, 2]
    return trimesh.Trimesh(ball.vertices * (1 - depth * np.clip(height, 0, 1) ** 4)[:, None], ball.faces)


@pytest.mark.parametrize("name", [*CATEGORIES, "ball", "cube"])
def test_a_copy_lies_on_its_original(name):
    """Cubes and balls have no axes to go by, a guitar hardly any thickness, a glass box two walls close together."""
    made = {"ball": BALL, "cube": trimesh.creation.box()}
    mesh = made[name] if name in made else generate(name, np.random.default_rng(3))
    assert apart(mesh, copy_of(mesh, np.random.default_rng(1))) < 0.7 * TOLERANCE


def test_the_same_mesh_gives_the_same_distance():
    cup, bowl = (generate(name, np.random.default_rng(0)) for name in ("cup", "bowl"))
    assert apart(cup, bowl) == apart(cup.copy(), bowl.copy()) > TOLERANCE


@pytest.mark.parametrize("fine", [BALL, trimesh.creation.torus(1, 0.35, 128, 64), trimesh.creation.capsule(2, 0.5)])
def test_simplifying_to_a_tenth_makes_no_other_shape(fine):
    assert apart(fine, fine.simplify_quadric_decimation(face_count=len(fine.faces) // 10)) < TOLERANCE / 2


def test_distances_are_in_sizes():
    """A box that is longer by 4 %, laid on the other: its faces lie about a hundredth of the length apart at most."""
    longer = apart(trimesh.creation.box([1, 2, 3]), trimesh.creation.box([1, 2, 3.12]))
    assert 0.001 < longer < 0.01
    assert longer == pytest.approx(apart(trimesh.creation.box([10, 20, 30]), trimesh.creation.box([1, 2, 3.12])))


NEARLY = {  # signatures farther apart than one shape's, surfaces together
    "a box a little wider": (trimesh.creation.box([1, 2, 3]), trimesh.creation.box([1.04, 2, 3])),
    "a bottle a little longer": (BOTTLE, trimesh.Trimesh(BOTTLE.vertices * [1, 1, 1.03], BOTTLE.faces)),
}
OTHER = {  # signatures near, surfaces apart
    "prisms of six and eight sides": [trimesh.creation.cylinder(1, 4, sections=sides) for sides in (6, 8)],
    "an apple and a ball": (BALL, dented(BALL, 0.2)),
}


@pytest.mark.parametrize("pair", NEARLY.values(), ids=NEARLY)
def test_a_near_copy_that_its_signature_does_not_give_away_is_the_same(pair):
    one, other = pair
    known = Shapes()
    known.add("one", signature(one))
    assert known.like(signature(other)) is None
    near = trained_on(one=one).nearest(signature(other), other)
    assert (near.id, near.same) == ("one", True)
    assert 0 < near.distance < TOLERANCE


@pytest.mark.parametrize("pair", OTHER.values(), ids=OTHER)
def test_another_shape_of_a_near_signature_is_another(pair):
    one, other = pair
    assert signatures_apart(one, other) < NEAR
    near = trained_on(one=one).nearest(signature(other), other)
    assert (near.id, near.same) == ("one", False)
    assert near.distance > 1.5 * TOLERANCE


def trained_on(**meshes):
    trained = Trained()
    for name, mesh in meshes.items():
        trained.add(name, signature(mesh), mesh)
    return trained


def test_of_several_near_signatures_the_nearest_surface_counts():
    prism, *others = (trimesh.creation.cylinder(1, 4, sections=sides) for sides in (7, 6, 8, 9))
    trained = trained_on(
        **{f"{len(mesh.faces)} faces": mesh for mesh in others}, cup=generate("cup", np.random.default_rng(0))
    )
    near = trained.nearest(signature(prism), prism)
    gaps = {f"{len(mesh.faces)} faces": apart(prism, mesh) for mesh in others}
    assert near.id == min(gaps, key=gaps.get)
    assert near.distance == pytest.approx(min(gaps.values()), abs=1e-5)


def test_where_no_signature_is_near_the_nearest_is_named_all_the_same():
    near = trained_on(ball=BALL).nearest(signature(trimesh.creation.box([1, 2, 9])), trimesh.creation.box([1, 2, 9]))
    assert (near.id, near.same) == ("ball", False)
    assert near.distance > 10 * TOLERANCE
    assert Trained().nearest(signature(BALL), BALL) is None
