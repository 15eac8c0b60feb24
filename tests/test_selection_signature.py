"""A shape's signature is blind to size, place, turn, mirror and triangles, and to nothing else."""

import numpy as np
import pytest
import trimesh

from graspfn.selection.procedural import CATEGORIES, generate
from graspfn.selection.signature import LENGTH, TOLERANCE, Shapes, signature

SHAPES = {name: generate(name, np.random.default_rng(3)) for name in CATEGORIES}


def distance(a, b):
    return np.abs(signature(a) - signature(b)).max()


def similar(mesh, rng):
    """The mesh scaled by up to 50, mirrored, turned and moved."""
    T = trimesh.transformations.random_rotation_matrix(rand=rng.random(3))[:3, :3] * rng.uniform(0.02, 50)
    vertices = mesh.vertices * [-1, 1, 1] @ T.T + rng.normal(size=3)
    return trimesh.Trimesh(vertices, mesh.faces[:, ::-1], process=False)


@pytest.mark.parametrize("name", SHAPES)
def test_similar_and_subdivided_copies_have_one_signature(name):
    rng = np.random.default_rng(0)
    mesh = SHAPES[name]
    assert signature(mesh).shape == (LENGTH,)
    assert distance(mesh, similar(mesh, rng)) < 1e-6
    assert distance(mesh, similar(mesh.subdivide(), rng)) < 1e-6


def test_a_ball_agrees_with_its_closed_form():
    """Radii of gyration 1 / sqrt 3, fourth moment 1, area 4 pi, in units of the cube root of the volume."""
    size = (4 * np.pi / 3) ** (1 / 3)
    one = np.log([3**-0.5 / size] * 3 + [(4 * np.pi) ** 0.5 / size, 1 / size])
    ball = trimesh.creation.icosphere(5)
    np.testing.assert_allclose(signature(ball), [*one, *one, 0], atol=2e-3)


def test_remeshing_moves_a_signature_by_less_than_the_tolerance():
    fine = [trimesh.creation.icosphere(5), trimesh.creation.torus(1, 0.35, 128, 64), trimesh.creation.capsule(2, 0.5)]
    for mesh in fine:
        for share in (0.5, 0.25):
            fewer = mesh.simplify_quadric_decimation(face_count=int(share * len(mesh.faces)))
            assert distance(mesh, fewer) < TOLERANCE


def test_different_shapes_differ():
    known = Shapes()
    for name, mesh in SHAPES.items():
        assert known.like(signature(mesh)) is None
        known.add(name, signature(mesh))
    stretched = SHAPES["cup"].copy()
    stretched.apply_scale([1, 1, 1.1])
    assert known.like(signature(stretched)) is None
    for name, mesh in SHAPES.items():
        assert known.like(signature(similar(mesh, np.random.default_rng(1)))) == name


def test_a_hollow_is_part_of_the_shape():
    """A ball and a bowl of it have nearly one hull."""
    ball = trimesh.creation.icosphere(4)
    bowl = trimesh.boolean.difference([ball, trimesh.creation.icosphere(4, 0.9).apply_translation([0, 0, 0.3])])
    assert distance(ball, bowl) > 10 * TOLERANCE
