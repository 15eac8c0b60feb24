"""A collision mesh has few faces and stays within its tolerance of the mesh, measured by brute force."""

import itertools
from types import SimpleNamespace

import fast_simplification
import numpy as np
import pytest
import trimesh

from graspfn.selection import collision
from graspfn.selection.collision import collision_mesh, outside
from graspfn.selection.procedural import CATEGORIES, generate

FACES, TOLERANCE = 200, 2e-3


def farthest(points, mesh):
    """Largest distance of points (n, 3) from the surface of a mesh: every point against every triangle."""
    worst = 0.0
    for point in points:
        nearest = trimesh.triangles.closest_point(mesh.triangles, np.tile(point, (len(mesh.faces), 1)))
        worst = max(worst, np.linalg.norm(nearest - point, axis=1).min())
    return worst


def sized(mesh, size=0.12):
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    mesh.apply_scale(size / mesh.extents.max())
    return mesh


def egg_crate(sheets):
    """Sheets that cross in edges of four faces each, as in ModelNet: none of those can be collapsed."""
    across = np.linspace(-0.06, 0.06, 2 * sheets + 1)
    quads = []
    for place in across[1::2]:
        for a, b in itertools.pairwise(across):
            for low, high in ((0, 0.01), (0.01, 0.02)):
                quads.append([[place, a, low], [place, b, low], [place, b, high], [place, a, high]])
                quads.append([[a, place, low], [b, place, low], [b, place, high], [a, place, high]])
    corners = np.array(quads).reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    mesh = trimesh.Trimesh(corners, faces, process=False)
    mesh.merge_vertices()
    return mesh.subdivide().subdivide()


@pytest.mark.parametrize("category", sorted(CATEGORIES))
def test_fewer_faces_within_the_tolerance(category):
    mesh = sized(generate(category, np.random.default_rng(2)))
    simple = collision_mesh(mesh, FACES, TOLERANCE)
    assert len(simple.faces) <= max(FACES, len(mesh.faces))
    assert farthest(mesh.vertices, simple) <= TOLERANCE + 1e-9
    assert farthest(simple.vertices, mesh) <= TOLERANCE + 1e-9


def test_a_dense_smooth_mesh_comes_down_to_the_budget():
    ball = trimesh.creation.icosphere(5, 0.03)
    assert len(collision_mesh(ball, FACES, TOLERANCE).faces) <= FACES
    assert len(collision_mesh(ball, FACES, TOLERANCE / 20).faces) > 2 * FACES


def test_a_mesh_within_the_budget_is_left_alone():
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    assert np.array_equal(collision_mesh(box, FACES, TOLERANCE).triangles, box.triangles)


def test_a_crate_of_crossing_sheets_has_fewer_too():
    mesh = egg_crate(10)
    simple = collision_mesh(mesh, FACES, TOLERANCE)
    assert len(simple.faces) < 0.8 * len(mesh.faces)
    assert farthest(mesh.vertices[::40], simple) <= TOLERANCE + 1e-9
    assert farthest(simple.vertices[::40], mesh) <= TOLERANCE + 1e-9


def test_every_attempt_has_a_good_many_more_faces_than_the_last(monkeypatch):
    """Where no further edge can be collapsed, asking for a face more gives the same mesh again."""
    made = []

    def simplify(vertices, faces, **options):
        result = fast_simplification.simplify(vertices, faces, **options)
        made.append(len(result[1]))
        return result

    monkeypatch.setattr(collision, "fast_simplification", SimpleNamespace(simplify=simplify))
    collision_mesh(egg_crate(10), FACES, TOLERANCE)
    second = made.index(made[0], 1)  # the corners drawn together, from the start again
    for attempts in (made[:second], made[second:]):
        assert len(attempts) > 3
        assert min(np.array(attempts[1:]) / attempts[:-1]) > 1.4


@pytest.mark.parametrize("tolerance", [1e-4, 3e-3, 0.05])
def test_outside_agrees_with_brute_force(tolerance):
    rng = np.random.default_rng(4)
    mesh = sized(generate("chair", rng))
    points = np.vstack([rng.uniform(-0.08, 0.08, (150, 3)), mesh.vertices[:50] + rng.normal(scale=2e-3, size=(50, 3))])
    expected = [farthest(point[None], mesh) > tolerance for point in points]
    assert outside(points, mesh, tolerance).tolist() == expected
