"""Mass, centre and inertia agree with closed forms, wherever the mesh lies and whether or not it is closed."""

import numpy as np
import pytest
import trimesh

from graspfn.meshes.mass import mass_properties


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
    opened = trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 2] < 0.5], process=False)
    assert mass_properties(opened, 100.0)[0] == pytest.approx(0.1)


def test_what_no_body_could_weigh_has_the_mass_of_its_hull():
    """A ball, and beside it a slightly smaller one inside out: closed, of some volume, its centre far outside it."""
    ball = trimesh.creation.icosphere(3, 0.02)
    hole = trimesh.creation.icosphere(3, 0.019).apply_translation([0.06, 0, 0])
    hole.invert()
    both = trimesh.util.concatenate([ball, hole])
    assert both.is_watertight and both.volume > 0
    mass, inertia = mass_properties(both, 100.0)
    assert mass == pytest.approx(100 * both.convex_hull.volume)
    assert np.linalg.eigvalsh(inertia).min() > 0
