"""Height maps of things whose heights are known, from any camera and pose, and of real cameras."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy import ndimage
from test_imaging_camera import BARREL, CAMERAS, orbited
from test_imaging_table import LAX, LIMITS, NOISE

from graspfn.geometry.grid import axes
from graspfn.geometry.transforms import T_world_scene, translation
from graspfn.imaging.camera import Camera, straight_down
from graspfn.imaging.height_map import BAND_M, CELL_M, SHAPE, TABLE_M, _enough, _heights, height_map
from graspfn.imaging.holes import DepthError
from graspfn.imaging.network_input import depth_input
from graspfn.imaging.noise import add_noise
from graspfn.imaging.render import render_depth
from graspfn.imaging.sight import look
from graspfn.imaging.table import TableError, fit_table
from graspfn.planning.centroid import centroid_grasp

REAL = Path(__file__).parents[1] / "../shared/data/depth"
CAMERA = Camera.of_the_paper(640, 480, 570.0)
V, U = ((np.arange(n) - (n - 1) / 2) * CELL_M for n in SHAPE)
ANY = pytest.mark.parametrize("camera", [*CAMERAS.values(), BARREL], ids=[*CAMERAS, "barrel"])


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def outside(size: tuple[float, float], shift: np.ndarray, theta: float) -> np.ndarray:
    """(132, 176) how far each cell's centre is from the footprint of a box at `T_world_scene`, negative inside, m."""
    T = np.linalg.inv(T_world_scene(shift, theta))
    x, y = np.moveaxis(np.stack(np.meshgrid(U, -V), axis=-1) @ T[:2, :2].T + T[:2, 3], -1, 0)
    return np.maximum(np.abs(x) - size[0] / 2, np.abs(y) - size[1] / 2)


def test_cells_of_q_are_four_by_four_of_the_map():
    v, u, _ = axes()
    np.testing.assert_allclose(V.reshape(-1, 4).mean(axis=1), v)
    np.testing.assert_allclose(U.reshape(-1, 4).mean(axis=1), u)


@ANY
@pytest.mark.parametrize("tilt", [0, 10, 19])
@pytest.mark.parametrize("height", [0.02, 0.06, 0.15])
def test_the_map_of_a_box_is_the_box_to_a_cell(camera, tilt, height, rng):
    """With the noise of eq. 2, by a camera that is believed to look straight down from 3 cm too high."""
    camera = camera.at(orbited(camera.position[2], tilt, 0.7))
    shift, theta = np.array([0.02, -0.03]), 0.5
    T = T_world_scene(shift, theta) @ translation(0, 0, height / 2)
    depth = add_noise(render_depth(trimesh.creation.box((0.1, 0.06, height)), T, camera), NOISE, rng)
    refined = camera.at(fit_table(depth, camera.at(straight_down(camera.position[2] + 0.03)), LIMITS).T_world_camera)
    np.testing.assert_allclose(refined.position[2], camera.position[2], atol=1e-4)
    seen = height_map(depth, camera)
    far = outside((0.1, 0.06), shift, theta)
    top, table = far < -CELL_M, (far > 1.5 * CELL_M) & seen.seen
    assert np.abs(seen.heights[top] - height).mean() < 0.001
    assert np.abs(seen.heights[top] - height).max() < 0.006
    assert (seen.heights[table] > TABLE_M).mean() < 0.001
    assert abs(seen.heights[table].mean()) < 0.0002
    assert seen.seen[top].all()


@ANY
@pytest.mark.parametrize("tilt", [0, 19])
def test_the_map_of_a_bare_table_is_0_within_noise(camera, tilt, rng):
    camera = camera.at(orbited(camera.position[2], tilt, 0.7))
    seen = look(add_noise(camera.bare_table(), NOISE, rng), camera, "height_map", LIMITS).seen
    heights = seen.heights[seen.seen]
    assert abs(heights.mean()) < 0.0001
    assert heights.std() < 0.001
    assert np.abs(heights).max() < 0.006
    assert look(camera.bare_table(), camera, "height_map", LIMITS).inputs[0].max() == 0


def test_a_sphere_has_its_heights(rng):
    ball = trimesh.creation.icosphere(5, 0.05)
    depth = add_noise(render_depth(ball, translation(0.03, -0.02, 0.05), CAMERA), NOISE, rng)
    u, v = np.meshgrid(U - 0.03, V - 0.02)
    inside = np.hypot(u, v) < 0.04
    expected = 0.05 + np.sqrt(np.where(inside, 0.05**2 - u**2 - v**2, 0))
    error = (height_map(depth, CAMERA).heights - expected)[inside]
    assert abs(np.median(error)) < 0.001
    assert np.percentile(np.abs(error), 95) < 0.003


@pytest.mark.parametrize(("rows", "columns"), [(8, -20), (-12, 30)])
def test_moving_the_object_moves_its_map(rows, columns):
    """By whole cells, and apart from what a camera sees of its sides."""
    mesh = trimesh.creation.cylinder(0.03, 0.05)
    here, there = (
        height_map(render_depth(mesh, translation(*xy, 0.025), CAMERA), CAMERA)
        for xy in ((0, 0), (columns * CELL_M, -rows * CELL_M))
    )
    moved = np.roll(here.heights, (rows, columns), axis=(0, 1))
    differs = np.abs(moved - there.heights) > 0.001
    u, v = np.meshgrid(U - columns * CELL_M, V - rows * CELL_M)
    assert (np.abs(np.hypot(u, v) - 0.03) < 1.5 * CELL_M)[differs].all()
    top, moved_top = here.heights > 0.049, there.heights > 0.049
    assert moved_top.sum() == pytest.approx(top.sum(), rel=0.05)
    grasps = centroid_grasp(here), centroid_grasp(there)
    np.testing.assert_allclose(grasps[1][:2] - grasps[0][:2], np.array([columns, rows]) * CELL_M, atol=0.001)


def test_what_the_object_hides_is_unseen_and_nothing_stands_there(rng):
    camera = CAMERA.at(orbited(0.5, 19))  # from the lower edge of the map, -y
    depth = add_noise(render_depth(trimesh.creation.box((0.1, 0.05, 0.1)), translation(0, 0, 0.05), camera), NOISE, rng)
    seen = height_map(depth, camera)
    shadow = (np.abs(U) < 0.03)[None, :] & ((V > -0.043) & (V < -0.03))[:, None]
    assert not seen.seen[shadow].any()
    assert (seen.heights[~seen.seen] == 0).all()


@pytest.mark.parametrize("nothing", [0.0, np.nan, np.inf, -1.0, 65.535])
def test_pixels_without_a_measurement_are_not_seen(nothing, rng):
    depth = CAMERA.bare_table().astype(np.float32)
    depth[100:140, 200:260] = nothing
    seen = height_map(depth, CAMERA)
    u, v = CAMERA.pixel_to_table(np.array([230.0, 120.0]))
    row, column = round((v - V[0]) / CELL_M), round((u - U[0]) / CELL_M)
    assert not seen.seen[row - 4 : row + 4, column - 4 : column + 4].any()
    assert 0.9 < seen.seen.mean() < 1


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_single_pixels_without_a_measurement_leave_no_hole(share, rng):
    depth = add_noise(CAMERA.bare_table(), NOISE, rng)
    depth[rng.random(depth.shape) < share] = 0
    seen = height_map(depth, CAMERA)
    assert seen.seen.mean() > 0.999
    assert abs(seen.heights.mean()) < 0.0002


def test_single_pixels_that_are_wrong_stand_nowhere(rng):
    depth = CAMERA.bare_table()
    depth[rng.random(depth.shape) < 0.005] = 0.3
    assert height_map(depth, CAMERA).heights.max() < TABLE_M


def test_byte_order_strides_and_precision_do_not_show(rng):
    depth = add_noise(CAMERA.bare_table(), NOISE, rng)
    wide = np.zeros((480, 1280), np.float32)
    wide[:, ::2] = depth
    expected = look(depth, CAMERA, "height_map", LIMITS).seen.heights
    for same in (depth.astype(">f4"), depth.astype(float), np.asfortranarray(depth), wide[:, ::2]):
        np.testing.assert_array_equal(look(same, CAMERA, "height_map", LIMITS).seen.heights, expected)


def highest_together(points, enough):
    """The mean of the highest of which enough lie within BAND_M; if nowhere, of the very highest. As it is said."""
    means = []
    for highest in sorted(points, reverse=True):
        together = [point for point in points if highest - BAND_M <= point <= highest]
        means.append(np.mean(together))
        if len(together) >= enough:
            return means[-1]
    return means[0]


def test_a_cell_takes_the_highest_points_that_lie_together(rng):
    """Of surfaces under strays, of walls, and of what nothing bears out."""
    heights = [
        np.concatenate([rng.uniform(0, 0.3, rng.integers(0, 4)), rng.uniform(0, 0.2) + spread * rng.random(count)])
        for spread in (0.001, 0.01, 0.2)
        for count in rng.integers(1, 30, size=200)
    ]
    cells = rng.choice(SHAPE[0] * SHAPE[1], len(heights), replace=False)
    cell = np.repeat(cells, [len(points) for points in heights])
    height, mixed = np.concatenate(heights).astype(np.float32), rng.permutation(len(cell))
    found = _heights(cell[mixed], height[mixed], CAMERA).ravel()
    assert np.isnan(np.delete(found, cells)).all()
    starts = np.flatnonzero(np.r_[True, np.diff(cell) != 0])
    highest, counts = np.zeros(found.size), np.zeros(found.size, dtype=int)
    highest[cells], counts[cells] = np.maximum.reduceat(height, starts), [len(points) for points in heights]
    enough = _enough(highest, counts, CAMERA)[cells]
    expected = [
        highest_together(points, least) for points, least in zip(np.split(height, starts[1:]), enough, strict=True)
    ]
    np.testing.assert_allclose(found[cells], expected, atol=1e-6)


def test_without_the_fit_the_pose_is_believed():
    depth = CAMERA.bare_table() - 0.01
    believed = LIMITS.__class__(False, *list(vars(LIMITS).values())[1:])
    assert np.allclose(look(depth, CAMERA, "height_map", believed).seen.heights, 0.01, atol=1e-5)
    assert np.allclose(look(depth, CAMERA, "height_map", LIMITS).seen.heights, 0, atol=1e-4)


def test_inputs_have_their_channels_and_low_things_are_table():
    depth = CAMERA.bare_table().astype(np.float32)
    depth[100:150, 100:150] -= np.float32(0.05)
    depth[300:350, 300:350] -= np.float32(0.004)
    of_depth, of_map = (look(depth, CAMERA, kind, LIMITS).inputs for kind in ("depth", "height_map"))
    assert (of_depth.shape, of_map.shape) == ((1, 132, 176), (2, 132, 176))
    assert of_depth.dtype == of_map.dtype == np.float32
    np.testing.assert_array_equal(of_depth[0], depth_input(depth, CAMERA))
    assert set(np.unique(of_map[1])) <= {0, 1}
    assert of_map[0].max() == pytest.approx(0.5, abs=0.01)
    assert np.all((of_map[0] == 0) | (of_map[0] > 0.4))


@pytest.mark.parametrize(
    "camera",
    [CAMERA.at(straight_down(0.45)), CAMERA.at(orbited(CAMERA.table_depth, 2)), CAMERAS["azure_kinect"], BARREL],
)
def test_the_papers_input_takes_the_papers_camera(camera):
    with pytest.raises(DepthError, match=r"^camera: .* px span 10 mm .*; height_map takes any camera$"):
        look(camera.bare_table(), camera, "depth", LIMITS)


@pytest.mark.skipif(not REAL.exists(), reason="no real depth images beside the repository")
@pytest.mark.parametrize("name", ["blue_mug", "green_bowl", "mustard"])
def test_a_real_camera_at_60_degrees_finds_table_and_object(name):
    """With the limit on the tilt lifted; under the default one it is refused."""
    with Image.open(REAL / f"realsense/{name}.depth.png") as image:
        depth = np.asarray(image).astype(np.float32) * 1e-4
    fx, _, cx, _, fy, cy, *_ = np.loadtxt(REAL / f"realsense/{name}.intrinsics.txt").ravel()
    camera = Camera(640, 480, (fx, fy, cx, cy), (), straight_down(0.3))
    with pytest.raises(TableError, match=r"^table: 6\d.\d degrees from under the camera; table.max_tilt_deg takes 20$"):
        fit_table(depth, camera, LIMITS)
    fit = fit_table(depth, camera, LAX)
    assert 55 < fit.tilt_deg < 70
    assert fit.inliers > 0.8
    assert fit.rms_m < 0.001
    # Q's middle to where what stands on the table is.
    points = camera.at(fit.T_world_camera).deproject(depth)[depth > 0]
    T = translation(*-np.median(points[points[:, 2] > 0.02], axis=0)[:2]) @ fit.T_world_camera
    seen = height_map(depth, camera.at(T))
    pieces, _ = ndimage.label(seen.heights > 0.02, np.ones((3, 3)))
    largest = np.bincount(pieces.ravel())[1:].max()
    assert (
        largest > 0.5 * (seen.heights > 0.02).sum()
    )  # of the mug the front and the far rim, with nothing seen between
    assert np.abs(seen.heights[seen.seen & (seen.heights < TABLE_M)]).mean() < 0.001
    assert 0.06 < seen.heights.max() < 0.25
    assert np.hypot(*centroid_grasp(seen)[:2]) < 0.06
