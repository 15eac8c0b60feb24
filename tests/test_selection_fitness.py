"""Meshes that cannot be objects are rejected, each for its own reason; odd but sound ones pass."""

import numpy as np
import pytest
import trimesh

from graspfn.meshes.errors import RejectedMeshError
from graspfn.selection.cleaning import clean

BOX = trimesh.creation.box()
BALL = trimesh.creation.icosphere(3)


def raw(vertices, faces):
    return trimesh.Trimesh(vertices, faces, process=False)


def with_vertex(mesh, i, place):
    vertices = mesh.vertices.copy()
    vertices[i] = place
    return raw(vertices, mesh.faces)


def crumbs(count, size, seed):
    offsets = np.random.default_rng(seed).uniform(-1, 1, (count, 3))
    crumb = trimesh.creation.icosphere(0, size)
    return trimesh.util.concatenate([crumb.copy().apply_translation(offset) for offset in offsets])


def bad_meshes():
    yield "not finite", with_vertex(BOX, 0, [np.nan, 0, 0])
    yield "not finite", with_vertex(BOX, 3, [0, np.inf, 0])
    yield "too few faces: 0", raw(BOX.vertices, np.zeros((0, 3), dtype=int))
    yield "too few faces: 1", raw(BOX.vertices, BOX.faces[:1])
    yield "too few faces: 3", raw(BOX.vertices, BOX.faces[:3])
    yield "too few faces", raw(BOX.vertices, np.repeat(BOX.faces[:1], 12, axis=0))  # one face, again and again
    yield "too many faces", raw(BOX.vertices, np.repeat(BOX.faces, 50_000, axis=0))
    yield "no volume", raw(BOX.vertices * [1, 1, 0], BOX.faces)
    yield "no volume", raw(BOX.vertices * [1, 1e-3, 1e-3], BOX.faces)
    yield "no volume", raw(np.vander(np.linspace(0, 1, 4), 3), [[0, 1, 2], [1, 3, 2], [0, 1, 3], [0, 2, 3]])
    yield "stray vertex", with_vertex(BALL, 5, [0, 0, 100.0])
    yield "no volume", with_vertex(BALL, 5, [1e9, 0, 0])
    yield "stray vertex", with_vertex(with_vertex(BALL, 5, [0, 0, 100.0]), 300, [0, 90.0, 0])
    yield "not finite", raw(BALL.vertices * 1e308, BALL.faces)
    for seed in range(3):
        yield "crumbs", crumbs(1000, 0.01, seed)
    yield "too many parts: 35", trimesh.util.concatenate([BALL.copy().apply_scale(2), crumbs(3500, 0.01, 0)])
    yield "in pieces: 2", trimesh.util.concatenate([BALL, BALL.copy().apply_translation([2.5, 0, 0])])


@pytest.mark.parametrize(("reason", "mesh"), list(bad_meshes()))
def test_no_object_is_rejected_with_the_reason(reason, mesh):
    with pytest.raises(RejectedMeshError, match=f"^{reason}") as caught:
        clean(mesh)
    assert "\n" not in str(caught.value)


def test_a_mesh_without_points_is_rejected():
    with pytest.raises(RejectedMeshError, match="too few faces"):
        clean(trimesh.Trimesh())


def chain(links):
    """Rings that hang in each other and do not touch."""
    ring = trimesh.creation.torus(1.0, 0.12)
    turned = ring.copy().apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    return trimesh.util.concatenate(
        [(ring, turned)[k % 2].copy().apply_translation([1.5 * k, 0, 0]) for k in range(links)]
    )


def handle():
    """A wire, thin beside its plate, that stands out by half the plate's length."""
    return trimesh.creation.box([0.004, 0.004, 0.5]).apply_translation([0.3, 0.3, 0.26])


def good_meshes():
    yield with_vertex(BALL, 5, [0, 0, 5.0])  # a ball with a spike
    yield trimesh.creation.cylinder(0.01, 2.0)
    yield raw(BOX.vertices * [1, 1, 0.005], BOX.faces)
    yield trimesh.creation.cone(0.05, 1.0)
    yield raw(np.vstack([BOX.vertices, [[1e9, 0, 0]]]), BOX.faces)  # a stray vertex that no face uses
    yield trimesh.util.concatenate([BALL, BALL.copy().apply_translation([2.05, 0, 0])])  # all but touching
    yield raw(BALL.vertices * 1e-7, BALL.faces)
    yield raw(BALL.vertices * 1e7 + 1e8, BALL.faces)
    yield raw(np.vstack([BOX.vertices, [[np.nan, 0, 0]]]), BOX.faces)  # nor one that is no number
    yield chain(20)
    yield trimesh.boolean.union([trimesh.creation.box([1, 1, 0.05]), handle()])


@pytest.mark.parametrize("mesh", list(good_meshes()))
def test_an_odd_but_sound_mesh_passes(mesh):
    cleaned = clean(mesh)
    assert cleaned.mesh.is_volume


def test_a_cloud_of_loose_triangles_takes_no_quadratic_time():
    """Fifty thousand pieces and as many rims beside a ball: comparing all with all would take hours."""
    rng = np.random.default_rng(0)
    corners = (rng.uniform(-1, 1, (50_000, 1, 3)) + rng.normal(scale=0.02, size=(50_000, 3, 3))).reshape(-1, 3)
    cloud = raw(corners, np.arange(len(corners)).reshape(-1, 3))
    cleaned = clean(trimesh.util.concatenate([BALL, cloud]))
    assert cleaned.mass == "convex hull"
    assert len(cleaned.mesh.faces) == len(BALL.faces) + 50_000


@pytest.mark.parametrize("seed", range(30))
def test_random_rubbish_is_rejected_or_comes_out_sound(seed):
    """Random faces, holes, repeats, flips, collapsed faces, moved vertices: no crash, and what passes is whole."""
    rng = np.random.default_rng(seed)
    start = [BOX.subdivide(), BALL, crumbs(12, 0.6, seed), trimesh.creation.annulus(0.5, 1, 0.3)][seed % 4]
    vertices, faces = start.vertices.copy(), start.faces.copy()
    faces = faces[rng.random(len(faces)) > rng.choice([0, 0.05, 0.5])]
    some = rng.random(len(faces)) < rng.choice([0, 0.3])
    faces[some] = faces[some][:, ::-1]
    faces = np.vstack(
        [faces, faces[rng.random(len(faces)) < 0.2], rng.integers(len(vertices), size=(rng.choice([0, 9]), 3))]
    )
    vertices += rng.normal(scale=rng.choice([0, 1e-9, 1e-2]), size=vertices.shape)
    try:
        cleaned = clean(raw(vertices, faces))
    except RejectedMeshError as reason:
        assert ":" in str(reason)
        return
    mesh = cleaned.mesh
    assert np.isfinite(mesh.vertices).all()
    assert len(mesh.faces) > 0
    assert mesh.extents.max() == pytest.approx(np.ptp(vertices[np.unique(faces)], axis=0).max(), rel=1e-3)
    assert cleaned.mass == ("volume" if mesh.is_volume else "convex hull")
