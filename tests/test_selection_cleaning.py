"""Cleaning closes what can be closed, unites what overlaps, and says what it did."""

import numpy as np
import pytest
import trimesh

from graspfn.meshes.mass import HULL, VOLUME
from graspfn.selection.cleaning import HOLE, clean


def raw(vertices, faces):
    return trimesh.Trimesh(vertices, faces, process=False)


def moved(mesh, *offset):
    return mesh.copy().apply_translation(offset)


def inside_out(mesh):
    return raw(mesh.vertices, mesh.faces[:, ::-1])


def test_closed_mesh_passes_unchanged():
    torus = trimesh.creation.torus(1.0, 0.3)
    cleaned = clean(torus)
    assert (cleaned.mass, cleaned.steps) == (VOLUME, "")
    assert np.array_equal(cleaned.mesh.vertices, torus.vertices)
    assert np.array_equal(cleaned.mesh.faces, torus.faces)


def test_scrambled_windings_and_inside_out_are_turned():
    torus = trimesh.creation.torus(1.0, 0.3)
    some = np.random.default_rng(0).random(len(torus.faces)) < 0.5
    for flip in (some, np.ones_like(some)):
        cleaned = clean(raw(torus.vertices, np.where(flip[:, None], torus.faces[:, ::-1], torus.faces)))
        assert cleaned.mesh.is_volume
        assert cleaned.mesh.volume == pytest.approx(torus.volume)
        assert "turned" in cleaned.steps


def test_a_second_body_is_added_and_a_hollow_is_taken_away():
    ball = trimesh.creation.icosphere(3, 1.0)
    other = trimesh.creation.icosphere(3, 0.5)
    apart, hollow = inside_out(moved(other, 1.55, 0, 0)), inside_out(other)
    for second, volume in ((apart, ball.volume + other.volume), (hollow, ball.volume - other.volume)):
        cleaned = clean(trimesh.util.concatenate([ball, second]))
        assert cleaned.mass == VOLUME
        assert cleaned.mesh.volume == pytest.approx(volume, rel=1e-3)
        assert ("2 parts united" in cleaned.steps) == (second is apart)


def test_overlapping_parts_count_once():
    """Two unit cubes that share a quarter of their volume, and one inside another: nothing weighs twice."""
    cube = trimesh.creation.box()
    for parts, volume in (([cube, moved(cube, 0.5, 0.5, 0)], 1.75), ([cube, trimesh.creation.box([0.5] * 3)], 1.0)):
        cleaned = clean(trimesh.util.concatenate(parts))
        assert cleaned.mass == VOLUME
        assert cleaned.mesh.is_volume
        assert cleaned.mesh.volume == pytest.approx(volume)


def test_union_agrees_with_counting_random_points():
    rng = np.random.default_rng(1)
    parts = [moved(trimesh.creation.icosphere(2, 0.4), *rng.uniform(-0.4, 0.4, 3)) for _ in range(6)]
    cleaned = clean(trimesh.util.concatenate(parts))
    points = rng.uniform(-1, 1, (20_000, 3))
    inside = np.any([part.contains(points) for part in parts], axis=0)
    assert cleaned.mesh.volume == pytest.approx(8 * inside.mean(), abs=8 * 4 * np.sqrt(0.25 / len(points)))
    assert np.mean(cleaned.mesh.contains(points) == inside) > 0.999


def test_closed_surface_that_touches_itself_is_parted():
    """Two boxes that share an edge: with its vertices merged, as in an STL file, four faces meet in it."""
    cube = trimesh.creation.box()
    pair = trimesh.util.concatenate([cube, moved(cube, 1, 1, 0)])
    soup = raw(pair.triangles.reshape(-1, 3), np.arange(3 * len(pair.faces)).reshape(-1, 3))
    for mesh in (pair, soup):
        cleaned = clean(mesh)
        assert cleaned.mass == VOLUME
        assert cleaned.mesh.is_watertight
        assert cleaned.mesh.volume == pytest.approx(2.0)


def test_small_holes_are_closed_and_the_mouth_of_a_cup_is_not():
    ball = trimesh.creation.icosphere(4, 1.0)
    for cut, mass in ((0.99, VOLUME), (0.5, HULL)):  # caps of 0.28 and of 1.7 across
        opened = raw(ball.vertices, ball.faces[ball.triangles_center[:, 2] < cut])
        cleaned = clean(opened)
        assert cleaned.mass == mass
        assert ("holes closed" in cleaned.steps) == (mass == VOLUME)
        if mass == VOLUME:
            assert cleaned.mesh.volume == pytest.approx(ball.volume, rel=0.01)
    assert 0.28 < 2 * HOLE < 1.7


def test_a_patch_is_no_hole():
    """The rim of a loose scrap bounds the scrap, not a hole in something: it gets no second face."""
    box = trimesh.creation.box((1, 1, 1)).subdivide()
    scrap = raw([[0.52, 0, 0], [0.62, 0, 0], [0.52, 0.1, 0.02], [0.62, 0.1, 0]], [[0, 1, 2], [1, 3, 2]])
    cleaned = clean(trimesh.util.concatenate([box, scrap]))
    assert len(cleaned.mesh.faces) == len(box.faces) + 2


@pytest.mark.parametrize("size", [1e-4, 1.0, 1e4])
def test_triangle_soup_with_double_and_collapsed_faces_closes_at_any_unit_and_place(size):
    ball = trimesh.creation.icosphere(2, size)
    soup = ball.triangles.reshape(-1, 3) + np.array([30 * size, 0, 0])
    faces = np.arange(len(soup)).reshape(-1, 3)
    cleaned = clean(raw(soup, np.vstack([faces, faces[:5], [[0, 0, 1]]])))
    assert cleaned.mass == VOLUME
    assert len(cleaned.mesh.faces) == len(ball.faces)
    assert len(cleaned.mesh.vertices) == len(ball.vertices)
    assert "6 collapsed or repeated faces dropped" in cleaned.steps


def test_a_sheet_with_faces_on_both_sides_keeps_one_of_them():
    box = trimesh.creation.box((1, 2, 3)).subdivide()
    tub = raw(box.vertices, box.faces[box.face_normals[:, 2] < 0.5])
    cleaned = clean(trimesh.util.concatenate([tub, inside_out(tub)]))
    assert cleaned.mass == HULL
    assert len(cleaned.mesh.faces) == len(tub.faces)


def test_a_note_of_the_source_goes_first():
    box = trimesh.creation.box()
    box.metadata["source_note"] = "hull of a list of points"
    assert clean(box).steps == "hull of a list of points"


CUBE, BALL = trimesh.creation.box(), trimesh.creation.icosphere(3)


def cup():
    return trimesh.boolean.difference(
        [trimesh.creation.box([2, 2, 2]), trimesh.creation.box([1.6, 1.6, 1.9]).apply_translation([0, 0, 0.2])]
    )


def sized(mesh, size):
    return mesh.copy().apply_scale(size)


def nested():
    """(parts, the volume that they bound)"""
    shell, wall, core = BALL, inside_out(sized(BALL, 0.8)), sized(BALL, 0.3)
    yield "hollow", [shell, wall], 1 - 0.8**3
    yield "hollow, all inside out", [inside_out(shell), inside_out(wall)], 1 - 0.8**3
    yield "core in a hollow", [shell, wall, core], 1 - 0.8**3 + 0.3**3
    yield (
        "two hollows",
        [shell, inside_out(moved(core, 0.4, 0, 0)), inside_out(moved(core, -0.4, 0, 0))],
        1 - 2 * 0.3**3,
    )
    yield "solid in a solid", [shell, core], 1


@pytest.mark.parametrize(("parts", "share"), [case[1:] for case in nested()], ids=[case[0] for case in nested()])
def test_hollows_stay_hollow_and_cores_stay(parts, share):
    cleaned = clean(trimesh.util.concatenate(parts))
    assert cleaned.mass == VOLUME
    assert cleaned.mesh.volume == pytest.approx(share * BALL.volume, rel=1e-6)


def test_an_inside_out_part_in_the_mouth_of_another_is_no_hollow():
    vessel, cushion = cup(), sized(BALL, 0.7)
    cleaned = clean(trimesh.util.concatenate([vessel, inside_out(moved(cushion, 0, 0, 0.1))]))
    assert cleaned.mesh.volume == pytest.approx(vessel.volume + cushion.volume, rel=0.01)


def test_sheets_beside_a_solid_stay():
    """A table: a slab, and legs of sheets with faces on both sides, apart or joined to it."""
    slab = moved(trimesh.creation.box([1, 1, 0.05]), 0, 0, 1)
    leg = raw([[0.35, 0.4, 0], [0.45, 0.4, 0], [0.45, 0.4, 0.975], [0.35, 0.4, 0.975]], [[0, 1, 2], [0, 2, 3]])
    sheet = trimesh.util.concatenate([leg, inside_out(leg)])
    table = clean(trimesh.util.concatenate([slab, sheet, moved(sheet, -0.8, 0, 0)]))
    assert table.mass == HULL
    np.testing.assert_allclose(table.mesh.extents, [1, 1, 1.025])
    assert table.mesh.area == pytest.approx(slab.area + 2 * leg.area)  # of each sheet one side


@pytest.mark.parametrize("seed", range(4))
def test_cleaning_turns_with_the_mesh(seed):
    """Two stacked cubes that share a face, as in an STL file: whatever their orientation, the same solid comes out."""
    pair = trimesh.util.concatenate([CUBE, moved(CUBE, 0, 0, 1)])
    T = trimesh.transformations.random_rotation_matrix(rand=np.random.default_rng(seed).random(3))
    corners = trimesh.transform_points(pair.triangles.reshape(-1, 3), T).astype(np.float32)
    cleaned = clean(raw(corners, np.arange(len(corners)).reshape(-1, 3)))
    assert cleaned.mass == VOLUME
    assert cleaned.mesh.volume == pytest.approx(2, rel=1e-5)


@pytest.mark.parametrize("noise", [1e-9, 1e-7])
def test_a_soup_with_rounded_corners_closes(noise):
    corners = BALL.triangles.reshape(-1, 3)
    corners = corners + np.random.default_rng(0).uniform(-noise, noise, corners.shape)
    cleaned = clean(raw(corners, np.arange(len(corners)).reshape(-1, 3)))
    assert cleaned.mass == VOLUME
    assert len(cleaned.mesh.faces) == len(BALL.faces)


def test_a_colander_keeps_its_holes():
    bowl = trimesh.creation.icosphere(4)
    below = bowl.triangles_center[:, 2] < 0.2
    bowl = raw(bowl.vertices, bowl.faces[below][np.arange(below.sum()) % 40 > 0])
    cleaned = clean(bowl)
    assert cleaned.mass == HULL
    assert len(cleaned.mesh.faces) == len(bowl.faces)


def test_a_thin_frame_weighs_what_it_weighs():
    rods = [trimesh.creation.box([1, 0.008, 0.008])]
    for place in ((0, 0.5, 0), (0, 0.5, 0.5), (0, 0, 0.5)):
        rods.append(moved(rods[0], *place))
    for x in (-0.496, 0.496):
        rods += [moved(trimesh.creation.box([0.008, 0.5, 0.008]), x, 0.25, z) for z in (0, 0.5)]
        rods += [moved(trimesh.creation.box([0.008, 0.008, 0.5]), x, y, 0.25) for y in (0, 0.5)]
    cleaned = clean(trimesh.util.concatenate(rods))
    assert cleaned.mass == VOLUME
    assert cleaned.mesh.volume == pytest.approx(0.008**2 * (4 + 8 * 0.5), rel=0.05)
