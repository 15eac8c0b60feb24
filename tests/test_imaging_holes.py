"""What is a hole, and filled holes: against the definition read pixel by pixel, and on images of real cameras."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from graspfn.imaging.camera import Camera
from graspfn.imaging.height_map import height_map
from graspfn.imaging.holes import BEHIND_M, NEAR_M, DepthError, fill_holes, holes
from graspfn.imaging.network_input import depth_input
from graspfn.imaging.noise import add_noise
from graspfn.params import Noise
from graspfn.planning.centroid import centroid_grasp

REAL = Path(__file__).parents[1] / "../shared/data/depth"
CAMERA = Camera.of_the_paper(640, 480, 570.0)
SMALL = Camera.of_the_paper(64, 48, 570.0)
TABLE = CAMERA.table_depth
# How cameras and their drivers say that they measured nothing, and what no camera over a table can measure.
NOTHING = [0.0, -0.0, -1.0, np.nan, np.inf, -np.inf, 65.535, 65535.0, 8.191, 0.001, 1e30]


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def check_against_definition(depth, filled, radius, pixels):
    """Every one of the hole pixels: the mean of the valid ones within the radius, else one of the nearest."""
    rows, columns = np.nonzero(np.isfinite(depth) & (depth > 0))
    values = depth[rows, columns].astype(float)
    for row, column in pixels:
        distance2 = (rows - row) ** 2 + (columns - column) ** 2
        if (distance2 <= radius**2).any():
            assert filled[row, column] == pytest.approx(values[distance2 <= radius**2].mean(), rel=1e-6)
        else:
            nearest = values[distance2 == distance2.min()]
            assert np.abs(nearest - filled[row, column]).min() < 1e-6


@pytest.mark.parametrize("radius", [1.0, 2.5, 5.0, 60.0])
@pytest.mark.parametrize("share", [0.1, 0.6, 0.995])
def test_agrees_with_the_definition(rng, radius, share):
    depth = rng.uniform(0.3, 0.5, (40, 50)).astype(np.float32)
    depth[rng.random(depth.shape) < share] = 0
    depth[5:20, 10:30] = np.nan
    filled = fill_holes(depth, None, radius)
    valid = depth > 0
    assert np.array_equal(filled[valid], depth[valid])
    check_against_definition(depth, filled, radius, np.argwhere(~valid)[::7])


def disc_sum(image, radius):
    """(height, width) sums over the disc of `radius` pixels round every pixel, nothing outside the image."""
    height, width = image.shape
    running = np.pad(np.cumsum(image, axis=1), ((0, 0), (1, 0)))
    total = np.zeros_like(running[:, 1:])
    columns = np.arange(width)
    for dy in range(-int(min(radius, height - 1)), int(min(radius, height - 1)) + 1):
        reach = int(np.sqrt(radius**2 - dy**2))
        segment = running[:, np.minimum(columns + reach + 1, width)] - running[:, np.maximum(columns - reach, 0)]
        total[max(0, -dy) : height - max(0, dy)] += segment[max(0, dy) : height - max(0, -dy)]
    return total


def fill_everywhere(depth, radius):
    """The simple version: both sums and the nearest valid pixel of every pixel of the image, hole or not."""
    valid = np.isfinite(depth) & (depth > 0)
    nearest = ndimage.distance_transform_edt(~valid, return_distances=False, return_indices=True)
    filled = depth[tuple(nearest)].astype(float)
    count = disc_sum(valid.astype(np.int64), radius)
    total = disc_sum(np.where(valid, depth, 0.0).astype(float), radius)
    average = ~valid & (count > 0)
    filled[average] = total[average] / count[average]
    return filled.astype(np.float32)


@pytest.mark.parametrize("radius", [1.0, 5.0, 60.0])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_agrees_to_the_bit_with_filling_everywhere(rng, radius, kind):
    for share in (0.002, 0.3, 0.99):
        depth = rng.uniform(0.3, 0.45, (48, 64)).astype(kind)
        depth[rng.random(depth.shape) < share] = np.nan
        depth[:20, 30:] = 0  # wider than the smaller discs, at the edge
        filled = fill_holes(depth, SMALL, radius)
        assert filled.dtype == np.float32
        assert np.array_equal(filled, fill_everywhere(depth, radius))


def test_whole_image_stays(rng):
    depth = rng.uniform(0.3, 0.45, (48, 64)).astype(np.float32)
    assert np.array_equal(fill_holes(depth, SMALL), depth)


@pytest.mark.parametrize("nothing", NOTHING)
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_every_way_of_saying_nothing_is_a_hole(nothing, kind):
    depth = np.full((48, 64), 0.4, kind)
    depth[10:20, 10:30] = nothing
    assert holes(depth, SMALL).sum() == 10 * 20
    assert np.allclose(fill_holes(depth, SMALL), 0.4)


def test_where_the_camera_was_is_not_known_any_distance_may_be_seen():
    depth = np.array([[0.0, -1, np.nan, np.inf, 1e-3, 3.0, 65.0]])
    assert holes(depth, None).tolist() == [[True] * 4 + [False] * 3]


def test_all_that_stands_on_the_table_and_the_table_itself_are_seen(rng):
    """At the paper's noise not one pixel of many images is lost, nor of a table 2 cm out of level."""
    noise = Noise(sigma_p_px=1, sigma_d_mm=1.5)
    for tilt in (0.0, 0.02, -0.02):
        depth = (TABLE + tilt * np.linspace(-1, 1, 640) * np.ones((480, 1))).astype(np.float32)
        depth[200:260, 300:360] = rng.uniform(NEAR_M + 0.02, TABLE)
        for _ in range(3):
            seen = add_noise(depth, noise, rng)
            assert not holes(seen, CAMERA).any()
            assert np.array_equal(fill_holes(seen, CAMERA), seen)


def box():
    depth = np.full((480, 640), TABLE, np.float32)
    depth[200:242, 330:414] -= np.float32(0.04)
    return depth


@pytest.mark.parametrize("nothing", NOTHING)
def test_a_patch_of_nothing_on_the_table_moves_no_plan(nothing):
    patched = box()
    patched[300:340, 100:140] = nothing
    filled = fill_holes(patched, CAMERA)
    assert np.abs(depth_input(filled, CAMERA) - depth_input(box(), CAMERA)).max() < 1e-6
    whole = centroid_grasp(height_map(box(), CAMERA))
    np.testing.assert_allclose(centroid_grasp(height_map(patched, CAMERA)), whole, atol=1e-9)


@pytest.mark.parametrize("nothing", NOTHING)
def test_an_image_with_holes_is_no_input(nothing):
    depth = box()
    depth[300, 100] = nothing
    with pytest.raises(DepthError, match="1 of its 307200 pixels hold no depth; fill_holes fills them"):
        depth_input(depth, CAMERA)


@pytest.mark.parametrize("planner", [depth_input, height_map, fill_holes])
@pytest.mark.parametrize(
    ("depth", "says"),
    [
        (np.full((480, 640), 407, np.uint16), "is of uint16; it takes metres"),
        (np.full((480, 640), True), "is of bool"),
        (np.full((240, 320), 0.4), "is 320x240 pixels; the camera's are 640x480"),
        (np.full((640, 480), 0.4), "is 480x640 pixels"),
        (np.zeros((0, 0)), "has the shape"),
        (np.zeros(5), "has the shape"),
    ],
)
def test_what_is_no_image_of_the_camera_is_one_line(planner, depth, says):
    with pytest.raises(DepthError, match=says) as caught:
        planner(depth, CAMERA)
    assert "\n" not in str(caught.value)


def test_byte_order_strides_and_precision_do_not_show(rng):
    depth = box()
    depth[rng.random(depth.shape) < 0.02] = np.nan
    filled = fill_holes(depth, CAMERA)
    wide = np.zeros((480, 1280), np.float32)
    wide[:, ::2] = depth
    for same in (depth.astype(">f4"), depth.astype(float), np.asfortranarray(depth), wide[:, ::2]):
        assert np.array_equal(fill_holes(same, CAMERA), filled)
        whole = np.where(np.isnan(same), 0.3, same).astype(same.dtype)
        expected = depth_input(np.where(np.isnan(depth), np.float32(0.3), depth), CAMERA)
        assert np.allclose(depth_input(whole, CAMERA), expected, atol=1e-6)


@pytest.mark.parametrize("unit", [1000.0, 100.0])
def test_another_unit_is_refused(unit):
    with pytest.raises(DepthError, match=r"100% of it lies behind the table, which is 0\.407 m from the camera"):
        fill_holes(box() * unit, CAMERA)


def test_a_table_farther_than_the_cameras_is_refused_and_not_filled_in_from_the_object():
    with pytest.raises(DepthError, match="lies behind the table"):
        fill_holes(box() + np.float32(BEHIND_M + 0.01), CAMERA)


def test_filling_twice_is_filling_once(rng):
    depth = rng.uniform(0.3, 0.45, (48, 64))
    depth[rng.random(depth.shape) < 0.5] = 0
    assert np.array_equal(fill_holes(fill_holes(depth, SMALL), SMALL), fill_holes(depth, SMALL))


def test_one_valid_pixel_fills_the_image():
    depth = np.zeros((48, 64))
    depth[3, 60] = 0.37
    assert np.allclose(fill_holes(depth, SMALL), 0.37)


@pytest.mark.parametrize("shape", [(1, 64), (48, 1), (1, 1)])
def test_images_of_one_row_or_column_are_filled(shape):
    depth = np.full(shape, 0.37)
    depth.flat[1::3] = 0
    assert np.allclose(fill_holes(depth, None), 0.37)


@pytest.mark.parametrize("value", [0.0, np.nan])
@pytest.mark.parametrize("camera", [SMALL, None])
def test_nothing_valid_is_one_line(value, camera):
    with pytest.raises(DepthError, match=r"^depth image: no pixel holds a depth.*$"):
        fill_holes(np.full((48, 64), value), camera)


@pytest.mark.skipif(not REAL.exists(), reason="no real depth images beside the repository")
def test_real_images(rng):
    paths = sorted(REAL.rglob("*depth.png"))
    assert paths
    for path in paths:
        with Image.open(path) as image:
            depth = np.asarray(image).astype(np.float32) * 1e-4
        filled = fill_holes(depth, None)
        valid = depth > 0
        assert (filled > 0).all()
        assert np.array_equal(filled[valid], depth[valid])
        assert filled.max() <= depth.max()
        assert filled.min() >= depth[valid].min()
        check_against_definition(depth, filled, 5.0, rng.permutation(np.argwhere(~valid))[:20])
