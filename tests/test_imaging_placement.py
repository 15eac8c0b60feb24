"""Random placements keep the object in view and use all the room there is."""

import numpy as np
import pytest
import trimesh

from graspfn.geometry.transforms import T_world_scene, translation
from graspfn.imaging.camera import Camera
from graspfn.imaging.placement import FlatObject, random_placement, random_placements, shift_range, visible_hull
from graspfn.imaging.render import render_depth
from graspfn.imaging.warp import move_image

CAMERA = Camera.of_the_paper(640, 480, 570.0)
TABLE = CAMERA.table_depth
OBJECTS = {
    "plate": (trimesh.creation.cylinder(0.06, 0.004), translation(0, 0, 0.002)),
    "rod": (trimesh.creation.box((0.18, 0.004, 0.004)), translation(0, 0, 0.002)),
    "tower": (trimesh.creation.box((0.04, 0.06, 0.18)), translation(0.01, 0, 0.09)),
    "cone": (trimesh.creation.cone(0.05, 0.15), translation(0, 0.005, 0)),
}


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def border(depth):
    """Whether the object touches the image's border."""
    seen = depth < TABLE - 0.0005
    return seen[0].any() or seen[-1].any() or seen[:, 0].any() or seen[:, -1].any()


def visible(depth):
    """Number of the object's pixels."""
    return (depth < TABLE - 0.0005).sum()


@pytest.mark.parametrize("name", OBJECTS)
def test_placed_objects_stay_in_view(rng, name):
    """As the camera sees them, and as an augmented image shows them. The border itself may just be touched."""
    mesh, T = OBJECTS[name]
    centred = render_depth(mesh, T, CAMERA)
    wide = Camera.of_the_paper(1280, 960, 570.0)
    for shift, theta in zip(*random_placements(centred, rng, 6), strict=True):
        T_moved = T_world_scene(shift, theta) @ T
        outside = visible(render_depth(mesh, T_moved, wide)) - visible(render_depth(mesh, T_moved, CAMERA))
        assert outside <= 3
        moved = move_image(centred, shift, theta, CAMERA, TABLE)
        assert visible(moved) > 0.97 * visible(centred) - 10


@pytest.mark.parametrize("name", OBJECTS)
def test_the_ends_of_the_range_touch_the_border(name):
    mesh, T = OBJECTS[name]
    hull = visible_hull(render_depth(mesh, T, CAMERA))
    for theta in (0.3, 2.0):
        low, high = shift_range(hull, np.array(theta))
        for end in ([low[0], 0], [high[0], 0], [0, low[1]], [0, high[1]]):
            beyond = np.array(end) * (1 + 0.006 / np.abs(end).max())  # 6 mm, some 8 to 14 px
            assert border(render_depth(mesh, T_world_scene(beyond, theta) @ T, CAMERA))
            within = np.array(end) * (1 - 0.003 / np.abs(end).max())
            assert not border(render_depth(mesh, T_world_scene(within, theta) @ T, CAMERA))


def test_hull_decides_as_all_points_do(rng):
    """The range over the hull's few vertices is the range over every pixel of the object."""
    mesh, T = OBJECTS["cone"]
    depth = render_depth(mesh, T, CAMERA)
    hull = visible_hull(depth)
    rows, columns = np.nonzero(depth < TABLE - 0.0005)
    z = depth[rows, columns].astype(float)
    everything = np.column_stack([(np.column_stack([columns, rows]) - CAMERA.centre) * z[:, None] / CAMERA.K[0], z])
    assert len(hull) < len(everything) / 5
    theta = rng.uniform(0, 2 * np.pi, 20)
    assert np.allclose(shift_range(hull, theta), shift_range(everything, theta), atol=1e-6)


def test_angles_and_shifts_are_uniform(rng):
    depth = render_depth(*OBJECTS["plate"], CAMERA)
    shifts, theta = random_placements(depth, rng, 4000)
    assert np.histogram(theta, 8, (0, 2 * np.pi))[0].min() > 400
    low, high = shift_range(visible_hull(depth), theta)
    share = (shifts - low) / (high - low)
    for axis in (0, 1):
        assert np.histogram(share[:, axis], 8, (0, 1))[0].min() > 400
    assert abs(np.corrcoef(share.T)[0, 1]) < 0.06


def test_an_object_that_fills_an_axis_stays_centred_along_it(rng):
    depth = render_depth(trimesh.creation.cylinder(0.15, 0.2), translation(0, 0, 0.1), CAMERA)
    shift, _ = random_placement(depth, rng)
    assert shift[1] == 0


def test_one_pixel_wide_objects_have_a_place(rng):
    depth = np.full((480, 640), TABLE)
    depth[240, 100:500] = TABLE - 0.01
    shift, _ = random_placement(depth, rng)
    assert np.isfinite(shift).all()


def test_what_is_too_flat_to_see_stays_in_the_centre(rng):
    with pytest.raises(FlatObject, match=r"^depth image: no object stands above the table$"):
        visible_hull(np.full((480, 640), TABLE))
    shift, _ = random_placement(np.full((480, 640), TABLE), rng)
    assert (shift == 0).all()
