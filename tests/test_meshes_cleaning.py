"""Cleaning closes what can be closed and says why it rejects; mass agrees with closed forms."""

import numpy as np
import pytest
import trimesh

from graspfn.meshes.cleaning import CLOSED, HULL_MASS, REPAIRED, clean, fingerprint, mass_properties
from graspfn.meshes.errors import RejectedMeshError


def raw(vertices, faces):
    return trimesh.Trimesh(vertices, faces, process=False)


def test_box_agrees_with_its_closed_form():
    a, b, c = 0.03, 0.05, 0.11
    mass, inertia = mass_properties(trimesh.creation.box((a, b, c)), 500.0)
    assert mass == pytest.approx(500 * a * b * c)
    np.testing.assert_allclose(inertia, np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) * mass / 12, atol=1e-12)


def test_sphere_approaches_its_closed_form():
    mass, inertia = mass_properties(trimesh.creation.icosphere(4, 0.04), 1000.0)
    assert mass == pytest.approx(1000 * 4 / 3 * np.pi * 0.04**3, rel=5e-3)
    np.testing.assert_allclose(inertia, np.eye(3) * 0.4 * mass * 0.04**2, rtol=5e-3, atol=1e-9)


def test_mass_does_not_depend_on_place_and_inertia_turns_with_the_mesh():
    mesh = trimesh.creation.annulus(0.02, 0.05, 0.03)
    mass, inertia = mass_properties(mesh, 700.0)
    T = trimesh.transformations.random_rotation_matrix(rand=np.array([0.1, 0.5, 0.8]))
    T[:3, 3] = [3.0, -20.0, 7.0]
    moved_mass, moved_inertia = mass_properties(mesh.copy().apply_transform(T), 700.0)
    assert moved_mass == pytest.approx(mass)
    np.testing.assert_allclose(moved_inertia, T[:3, :3] @ inertia @ T[:3, :3].T, rtol=1e-6, atol=1e-9)


def test_open_mesh_has_the_mass_of_its_hull():
    box = trimesh.creation.box((0.1, 0.1, 0.1)).subdivide()
    opened = raw(box.vertices, box.faces[box.face_normals[:, 2] < 0.5])
    mesh, how = clean(opened)
    assert how == HULL_MASS
    assert not mesh.is_watertight
    assert mass_properties(mesh, 100.0)[0] == pytest.approx(0.1)


def test_closed_mesh_passes_unchanged():
    torus = trimesh.creation.torus(1.0, 0.3)
    mesh, how = clean(torus)
    assert how == CLOSED
    assert mesh.volume == pytest.approx(torus.volume)
    assert len(mesh.faces) == len(torus.faces)


def test_scrambled_windings_and_inside_out_are_repaired():
    torus = trimesh.creation.torus(1.0, 0.3)
    turned = np.random.default_rng(0).random(len(torus.faces)) < 0.5
    for flip in (turned, np.ones_like(turned)):
        mesh, how = clean(raw(torus.vertices, np.where(flip[:, None], torus.faces[:, ::-1], torus.faces)))
        assert how == REPAIRED
        assert mesh.is_volume
        assert mesh.volume == pytest.approx(torus.volume)


def test_one_inverted_body_is_turned_but_a_hollow_stays():
    ball = trimesh.creation.icosphere(2, 1.0)
    for centre, radius, sign in (([3.0, 0, 0], 1.0, 1), ([0, 0, 0], 0.5, -1)):
        other = trimesh.creation.icosphere(2, radius).apply_translation(centre)
        mesh, _ = clean(trimesh.util.concatenate([ball, raw(other.vertices, other.faces[:, ::-1])]))
        assert mesh.volume == pytest.approx(ball.volume + sign * other.volume)


def test_missing_triangle_and_missing_quad_are_filled():
    box = trimesh.creation.box((1, 2, 3))
    top = np.flatnonzero(box.face_normals[:, 2] > 0.5)
    for missing in (top[:1], top):
        mesh, how = clean(raw(box.vertices, np.delete(box.faces, missing, axis=0)))
        assert how == REPAIRED
        assert mesh.volume == pytest.approx(6.0)


@pytest.mark.parametrize("size", [1e-4, 1.0, 1e4])
def test_triangle_soup_with_double_and_collapsed_faces_closes_at_any_unit(size):
    ball = trimesh.creation.icosphere(2, size)
    soup = ball.triangles.reshape(-1, 3)
    faces = np.arange(len(soup)).reshape(-1, 3)
    mesh, how = clean(raw(soup, np.vstack([faces, faces[:5], [[0, 0, 1]]])))
    assert how == CLOSED
    assert len(mesh.faces) == len(ball.faces)
    assert len(mesh.vertices) == len(ball.vertices)


def bad_meshes():
    box = trimesh.creation.box()
    nan = box.vertices.copy()
    nan[0, 1] = np.nan
    yield "finite", nan, box.faces
    yield "0 faces", box.vertices, np.zeros((0, 3), dtype=int)
    yield "3 faces", box.vertices, box.faces[:3]
    yield "no volume", box.vertices * [1, 1, 0], box.faces
    yield "no volume", [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2], [0, 1, 3], [0, 2, 3]]
    yield "no volume", np.zeros((8, 3)), box.faces


@pytest.mark.parametrize(("reason", "vertices", "faces"), list(bad_meshes()))
def test_no_object_is_rejected_with_the_reason(reason, vertices, faces):
    with pytest.raises(RejectedMeshError, match=reason) as caught:
        clean(raw(vertices, faces))
    assert "\n" not in str(caught.value)


def test_fingerprint_tells_shapes_apart():
    box = trimesh.creation.box()
    assert fingerprint(box) == fingerprint(box.copy())
    assert fingerprint(box) != fingerprint(trimesh.creation.box((1, 1, 1.001)))
    assert fingerprint(box) != fingerprint(raw(box.vertices, box.faces[::-1]))


def test_closed_surface_that_touches_itself_stays_closed():
    """Two boxes that share an edge without sharing its vertices: welded there, four faces would meet in one edge."""
    touching = trimesh.util.concatenate([trimesh.creation.box(), trimesh.creation.box().apply_translation([1, 1, 0])])
    mesh, how = clean(touching)
    assert how == CLOSED
    assert mesh.volume == pytest.approx(2.0)
