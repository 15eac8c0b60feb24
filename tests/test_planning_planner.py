"""From a depth image to a pose in the robot's frame, and the images on which there is none to command."""

from __future__ import annotations

import dataclasses
import re
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch
import trimesh
from made_models import save_model
from physics_params import ATTEMPT, GRIPPER, PARAMS, PHYSICS
from scipy.spatial.transform import Rotation
from test_imaging_camera import orbited

from graspfn.geometry import grid
from graspfn.geometry.transforms import T_world_grasp, T_world_scene, move_pose, rotation_z, translation
from graspfn.imaging.camera import Camera, straight_down
from graspfn.imaging.disturbances import WAVE_M, missing, stepped, waves
from graspfn.imaging.height_map import CELL_M
from graspfn.imaging.holes import DepthError
from graspfn.imaging.noise import add_noise
from graspfn.imaging.render import render_depth
from graspfn.learning.folder import WeightsError
from graspfn.learning.networks import build_network
from graspfn.learning.weights import save_network
from graspfn.meshes.placed import Resting
from graspfn.params import Noise, Table
from graspfn.physics.attempt import Grasper, Outcome
from graspfn.physics.world import Rig
from graspfn.planning.model import FORMAT, GRID, ModelError
from graspfn.planning.objects import meets, objects
from graspfn.planning.planner import Grasp, GraspPlanner, Method, NoGrasp
from graspfn.planning.uncertainty import PlanningError, PoseUncertainty

CAMERA = Camera.of_the_paper(640, 480, 570.0)
NOISE = Noise(sigma_p_px=1, sigma_d_mm=1.5)
SIGMA = PoseUncertainty.of(5, 10)
POST = np.array([0.045, 0.0])  # of the object, in its own frame: where it is grasped, across the bar


def gripped_object() -> trimesh.Trimesh:
    """A low bar along x with a post at one end; a mirror or a half turn shows. It stands on z = 0."""
    bar = trimesh.creation.box((0.12, 0.03, 0.02), translation(0, 0, 0.01))
    post = trimesh.creation.box((0.03, 0.03, 0.07), translation(*POST, 0.035))
    return trimesh.boolean.union([bar, post])


OBJECT = gripped_object()


def post_predictor(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A network that knows the object: a peak at its post, to be closed on across the bar."""
    heights = inputs[0] / 10
    v, u = ((np.arange(n) - (n - 1) / 2) * CELL_M for n in heights.shape)

    def middle(part: np.ndarray) -> np.ndarray:
        rows, columns = np.nonzero(part)
        return np.array([u[columns].mean(), v[rows].mean()])

    if not (heights > 0.06).any() or not ((heights > 0.01) & (heights < 0.03)).any():
        return np.zeros(grid.SHAPE, np.float32), np.zeros(grid.SHAPE, np.uint8)
    post, bar = middle(heights > 0.06), middle((heights > 0.01) & (heights < 0.03))
    theta = np.arctan2(*(post - bar)[::-1]) + np.pi / 2
    off = grid.poses() - [*post, 0]
    turned = grid.angle_difference(off[..., 2], np.array(theta)) / grid.CELL_RAD
    f = np.exp(-0.5 * ((off[..., :2] ** 2).sum(axis=-1) / 0.01**2 + turned**2)).astype(np.float32)
    return f, np.rint(5 * f).astype(np.uint8)


PLANNER = GraspPlanner(post_predictor, "height_map", GRIPPER, PARAMS.table, PARAMS.plan, most_m=0.2)


def seen(camera: Camera, *things: tuple[trimesh.Trimesh, np.ndarray], noise: bool = True) -> np.ndarray:
    depth = np.minimum.reduce([render_depth(mesh, T, camera) for mesh, T in things])
    depth = np.where(np.isfinite(depth), depth, 0).astype(np.float32)
    return add_noise(depth, NOISE, np.random.default_rng(0)).astype(np.float32) if noise else depth


def placed(shift: tuple[float, float], theta: float) -> tuple[tuple[trimesh.Trimesh, np.ndarray], np.ndarray]:
    """The object on the table, and the pose (3,) that grasps it."""
    q = move_pose(np.array([POST[0], -POST[1], np.pi / 2]), np.array(shift), theta)
    return (OBJECT, T_world_scene(np.array(shift), theta)), q


def rigid(rng: np.random.Generator) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.uniform(-1, 1, 3)
    return T


def assert_same_grasp(T: np.ndarray, other: np.ndarray) -> None:
    """Frames of one grasp to 3 mm and 3 degrees; the jaws may change places."""
    turn = other[:3, :3].T @ T[:3, :3]
    np.testing.assert_allclose(T[:3, 3], other[:3, 3], atol=0.003)
    assert np.degrees(np.arccos(np.clip(turn[2, 2], -1, 1))) < 0.5
    assert np.degrees(np.arccos(min(abs(turn[0, 0]), 1))) < 3


CASES = [(0.0, 0.0, (0.0, 0.0), 0.3), (12.0, 1.0, (0.06, -0.04), 2.0), (18.0, 4.0, (-0.1, 0.05), 4.5)]


@pytest.mark.parametrize(("tilt", "azimuth", "shift", "theta"), CASES)
@pytest.mark.parametrize("posed", [True, False])
def test_the_pose_in_the_robots_frame_is_where_the_object_is(tilt, azimuth, shift, theta, posed):
    """Whatever is believed of the camera's height and tilt, and with nothing believed of where it stands at all."""
    rng = np.random.default_rng(int(tilt))
    thing, q = placed(shift, theta)
    camera = CAMERA.at(orbited(0.45, tilt, azimuth))
    believed = camera.T_world_camera.copy()
    believed[2, 3] += 0.03
    T_robot_world, T_robot_gripper = rigid(rng), rigid(rng)
    T_gripper_camera = np.linalg.inv(T_robot_gripper) @ T_robot_world @ camera.T_world_camera
    grasp = PLANNER.plan(
        seen(camera, thing),
        camera.at(believed if posed else straight_down(0.3)),
        SIGMA,
        posed=posed,
        T_robot_gripper=T_robot_gripper,
        T_gripper_camera=T_gripper_camera,
    )
    assert isinstance(grasp, Grasp), grasp.reason
    tips = translation(0, 0, GRIPPER.clearance_mm / 1000) @ T_world_grasp(q)
    assert_same_grasp(grasp.T_robot_grasp, T_robot_world @ tips)
    assert_same_grasp(grasp.T_camera_grasp, np.linalg.inv(camera.T_world_camera) @ tips)
    x, y, _ = camera.project(tips[:3, 3])
    np.testing.assert_allclose(grasp.pixel[:2], [x, y], atol=4)
    if posed:
        np.testing.assert_allclose(grasp.q[:2], q[:2], atol=0.003)
    else:  # the optical axis meets the table at the origin, and the image's x is u
        np.testing.assert_allclose(grasp.camera.pixel_to_table(camera.centre), 0, atol=1e-9)
        along = grasp.camera.T_world_camera[:3, 0]
        assert along[0] > 0 and along[1] == pytest.approx(0, abs=1e-12)
    assert grasp.table.tilt_deg == pytest.approx(tilt, abs=0.2)


def test_the_pixels_of_a_camera_straight_above_show_the_pose_itself():
    thing, q = placed((0.05, 0.03), 1.1)
    grasp = PLANNER.plan(seen(CAMERA, thing), CAMERA, SIGMA)
    np.testing.assert_allclose(grasp.pixel[:2], CAMERA.table_to_pixel(q[:2]), atol=4)
    assert abs(grid.angle_difference(grasp.pixel[2], q[2])) < np.radians(3)
    np.testing.assert_allclose(grasp.pixel[2], grasp.q[2], atol=0.01)


def test_what_is_planned_in_the_robots_frame_is_held():
    """From the rendered image of a tilted camera to DART, by way of the robot and its hand's camera."""
    rng = np.random.default_rng(3)
    thing, _ = placed((-0.05, 0.04), 0.8)
    camera = CAMERA.at(rotation_z(2.0) @ orbited(0.45, 15))
    T_robot_world, T_robot_gripper = rigid(rng), rigid(rng)
    hand = np.linalg.inv(T_robot_gripper) @ T_robot_world @ camera.T_world_camera
    frames = {"T_robot_gripper": T_robot_gripper, "T_gripper_camera": hand}
    grasp = PLANNER.plan(seen(camera, thing), camera, SIGMA, **frames)
    T_world_reached = np.linalg.inv(T_robot_world) @ grasp.T_robot_grasp
    assert T_world_reached[2, 3] == pytest.approx(GRIPPER.clearance_mm / 1000, abs=7e-4)  # over the table, not under it
    closing = T_world_reached[:3, 0]
    q = np.array([T_world_reached[0, 3], -T_world_reached[1, 3], np.arctan2(-closing[1], closing[0]) % np.pi])
    mesh = OBJECT.copy()
    mesh.apply_translation(-OBJECT.center_mass)
    T = thing[1] @ translation(*OBJECT.center_mass)
    grasper = Grasper(Resting(mesh, mesh, T), Rig(PHYSICS, GRIPPER, ATTEMPT))
    assert grasper.run(q).outcome is Outcome.HELD
    wrong = [q * [1, -1, 1], q * [-1, 1, 1], q + np.array([0, 0, np.pi / 2]), q[[1, 0, 2]]]
    assert not any(grasper.run(other).held for other in wrong)


def test_every_method_says_what_its_pose_promises():
    depth = seen(CAMERA, placed((0.0313, -0.0172), 0.7)[0])
    robust, best, centroid = (PLANNER.plan(depth, CAMERA, SIGMA, method) for method in Method)
    assert [g.method for g in (robust, best, centroid)] == ["robust", "best", "centroid"]
    assert robust.robust_score >= best.robust_score > centroid.robust_score
    np.testing.assert_allclose(best.score, best.function.f.max())
    for grasp in (robust, best, centroid):
        assert grasp.robust_score == pytest.approx(grasp.function.at(grasp.q[None]).item())
        assert grasp.function.f.shape == grasp.function.on_q.shape == grid.SHAPE
    certain = PLANNER.plan(depth, CAMERA, PoseUncertainty((0.0, 0.0)), "best")
    assert certain.score == certain.robust_score
    with pytest.raises(ValueError, match="likeliest"):
        PLANNER.plan(depth, CAMERA, SIGMA, "likeliest")


def test_the_same_image_gives_the_same_grasp_from_any_thread():
    scenes = [seen(CAMERA, placed((0.02 * i, -0.01 * i), i)[0]) for i in range(4)]
    alone = [PLANNER.plan(depth, CAMERA, SIGMA).q for depth in scenes]
    with ThreadPoolExecutor(4) as threads:
        together = list(threads.map(lambda depth: PLANNER.plan(depth, CAMERA, SIGMA).q, scenes * 3))
    np.testing.assert_array_equal(together, alone * 3)


def block(u: float, v: float, size: float = 0.03, height: float = 0.03) -> tuple[trimesh.Trimesh, np.ndarray]:
    return trimesh.creation.box((size, size, height)), translation(u, -v, height / 2)


def bar(length: float, height: float) -> tuple[trimesh.Trimesh, np.ndarray]:
    return trimesh.creation.box((length, 0.03, height)), translation(0, 0, height / 2)


def dome() -> tuple[trimesh.Trimesh, np.ndarray]:
    """It fills the view, and nothing of it is flat."""
    return trimesh.creation.icosphere(subdivisions=4, radius=0.5), translation(0, 0, -0.35)


LOW, HIGH = CAMERA, CAMERA.at(straight_down(0.7))  # the second sees more of the table than Q


@pytest.mark.parametrize(
    ("camera", "things", "says"),
    [
        (LOW, [block(0, 0, height=0.002)], "no object: nothing stands out of the table"),
        (LOW, [block(0, 0, size=0.006)], "no object: nothing stands out of the table"),
        (HIGH, [block(0.30, 0)], "no object: nothing stands out of the table"),
        (LOW, [block(-0.05, 0), block(0.05, 0)], "several objects: 2 that stand more than 30 mm apart; it takes one"),
        (LOW, [block(-0.1, 0), block(0.05, 0), block(0.1, 0.1)], "several objects: 3"),
        (LOW, [block(0.22, 0)], "the object leaves the view"),
        (LOW, [block(0.05, -0.16)], "the object leaves the view"),
        (HIGH, [block(0.22, 0, size=0.08)], "the object leaves the 44 x 33 cm of the table"),
        (HIGH, [block(0, 0.165, size=0.08)], "the object leaves the 44 x 33 cm of the table"),
        (CAMERA.at(straight_down(0.8)), [block(0, 0)], "table: .* table.max_offset_mm takes 100"),
        (CAMERA.at(orbited(0.45, 30)), [block(0, 0)], "table: 30.0 degrees from under the camera"),
        (CAMERA.at(straight_down(1.2)), [block(0, 0)], "camera: 1.20 m from the table 1.2 px see 2.5 mm, .* 0.95 m"),
        (
            LOW,
            [dome()],
            "table: .* mm rms rough; table.max_rms_mm takes 3",
        ),
        (HIGH, [bar(0.05, 0.3)], "the object is 30 cm high; the network's were up to 20"),
        (HIGH, [bar(0.34, 0.03)], "the object is 34 cm long; the network's were up to 28"),
        (LOW, [block(0, 0)], "score: no pose has one above 0"),
    ],
)
def test_where_there_is_no_grasp_the_reason_is_a_line(camera, things, says):
    believed = CAMERA if says.startswith("table: .*") else camera
    found = PLANNER.plan(seen(camera, *things), believed, SIGMA)
    assert isinstance(found, NoGrasp) and "\n" not in found.reason
    assert re.match(says, found.reason), found.reason


def test_an_image_far_noisier_than_any_of_training_has_no_table():
    depth = seen(CAMERA, placed((0.03, 0.0), 0.0)[0], noise=False)
    noisy = add_noise(depth, Noise(sigma_p_px=1, sigma_d_mm=12), np.random.default_rng(0)).astype(np.float32)
    assert re.match(r"table: .* mm rms rough; table.max_rms_mm takes 3", PLANNER.plan(noisy, CAMERA, SIGMA).reason)


def test_waves_of_the_table_are_no_objects():
    """Empty tables as rough as any that networks were trained on; and the flattest object stands out of them."""
    blank = CAMERA.bare_table().astype(np.float32)
    flat = seen(CAMERA, bar(0.06, 0.01), noise=False)
    for i in range(6):
        rng = np.random.default_rng(i)
        rough = 0.0017 * waves(CAMERA, WAVE_M, rng)
        depth = stepped(add_noise(blank, NOISE, rng) + rough, 0.003).astype(np.float32)
        assert PLANNER.plan(depth, CAMERA, SIGMA, posed=False).reason.startswith("no object")
        depth = stepped(add_noise(flat, NOISE, rng) + rough, 0.003).astype(np.float32)
        assert isinstance(PLANNER.plan(depth, CAMERA, SIGMA, "centroid", posed=False), Grasp)


def test_what_is_mostly_holes_around_the_object_is_not_planned_on():
    depth = seen(CAMERA, placed((0.03, 0.0), 0.0)[0])
    object_ = depth < CAMERA.bare_table() - 0.01
    for share, says in ((0.3, Grasp), (0.97, NoGrasp)):
        holes = missing(CAMERA, np.random.default_rng(1))(share)
        found = PLANNER.plan(np.where(holes & ~object_, np.float32(np.nan), depth), CAMERA, SIGMA)
        assert isinstance(found, says)
    assert re.match(r"holes: \d\d% of what is within 5 cm of the object is seen; it takes 50%", found.reason)


def test_an_image_without_depths_has_no_table():
    assert "hold a depth" in PLANNER.plan(np.zeros((480, 640), np.float32), CAMERA, SIGMA).reason


@pytest.mark.parametrize("gap", [0.02, 0.045])
def test_pieces_that_no_finger_fits_between_are_one_object(gap):
    mask = np.zeros((132, 176), dtype=bool)
    mask[60:70, 60:70] = mask[60:70, 70 + round(gap / CELL_M) :][:, :10] = True
    assert objects(mask) == (1 if gap < 0.03 else 2)


def test_a_pose_below_the_least_score_is_none():
    depth = seen(CAMERA, placed((0.03, 0.0), 0.0)[0])
    promised = PLANNER.plan(depth, CAMERA, SIGMA).robust_score
    assert isinstance(PLANNER.plan(depth, CAMERA, SIGMA, min_score=promised - 1e-6), Grasp)
    found = PLANNER.plan(depth, CAMERA, SIGMA, min_score=promised + 1e-3)
    assert found.reason.startswith(f"score: {promised:.3f} at best; min_score takes ")
    assert found.table.height_m == pytest.approx(CAMERA.table_depth, abs=1e-3)


def test_a_region_or_mask_leaves_the_rest_out():
    """Beside the object another one, and the robot's own arm across the image's edge."""
    thing, q = placed((0.07, 0.02), 0.4)
    arm = trimesh.creation.box((0.08, 0.2, 0.1)), translation(-0.2, 0.1, 0.2)
    depth = seen(CAMERA, thing, block(-0.08, -0.1), arm)
    assert isinstance(PLANNER.plan(depth, CAMERA, SIGMA), NoGrasp)
    x, y = CAMERA.table_to_pixel(q[:2]).round().astype(int)
    roi = int(x - 180), int(y - 140), 280, 280
    mask = np.zeros(depth.shape, dtype=bool)
    mask[roi[1] : roi[1] + 280, roi[0] : roi[0] + 280] = True
    grasps = [PLANNER.plan(depth, CAMERA, SIGMA, **view) for view in ({"roi": roi}, {"mask": mask})]
    for grasp in grasps:
        np.testing.assert_allclose(grasp.q[:2], q[:2], atol=0.003)
    cut = PLANNER.plan(depth, CAMERA, SIGMA, roi=(int(x) - 40, int(y) - 40, 80, 80))
    assert cut.reason == "the object leaves the view"


def test_poses_are_only_where_the_gripper_meets_the_object():
    """A network that is as sure everywhere else."""

    def sure(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.full(grid.SHAPE, 0.9, np.float32), np.full(grid.SHAPE, 5, np.uint8)

    planner = dataclasses.replace(PLANNER, predict=sure)
    thing = (
        trimesh.creation.box((0.1, 0.02, 0.03)),
        T_world_scene(np.array([0.1, -0.05]), 0.0) @ translation(0, 0, 0.015),
    )
    f = planner.plan(seen(CAMERA, thing), CAMERA, SIGMA).function.f
    off = grid.poses()[..., :2] - [0.1, -0.05]
    across = np.abs(off[:, :, 3]) - [0.05, 0.01]  # theta = 90 degrees: it closes along v
    reach = [GRIPPER.finger_width_mm / 2000, GRIPPER.opening_mm / 2000]
    assert np.all(f[:, :, 3][(across < reach).all(axis=-1)] == 0.9)
    assert np.all(f[:, :, 3][(across > np.array(reach) + 0.021).any(axis=-1)] == 0)
    everywhere = np.ones((132, 176), dtype=bool)
    assert meets(everywhere, GRIPPER).all() and not meets(~everywhere, GRIPPER).any()


@pytest.mark.parametrize(
    ("given", "error", "says"),
    [
        ({"depth": np.zeros((480, 640), np.uint16)}, DepthError, "depth image: is of uint16"),
        ({"depth": np.zeros((240, 320))}, DepthError, "depth image: is 320x240 pixels"),
        ({"roi": (600, 0, 100, 100)}, PlanningError, r"roi: \(600, 0, 100, 100\) is not within the image"),
        ({"roi": (0, 0, 0, 100)}, PlanningError, "roi"),
        ({"mask": np.ones((2, 2), bool)}, PlanningError, "mask: has the shape"),
        ({"mask": np.zeros((480, 640), bool)}, PlanningError, "mask: no pixel is left"),
        ({"T_robot_gripper": np.eye(4)}, PlanningError, "T_gripper_camera: missing"),
        ({"T_robot_gripper": 2 * np.eye(4), "T_gripper_camera": np.eye(4)}, PlanningError, "T_robot_gripper: takes a"),
        (
            {"T_robot_gripper": np.eye(4), "T_gripper_camera": np.diag([1, 1, -1, 1])},
            PlanningError,
            "T_gripper_camera: takes a rigid",
        ),
    ],
)
def test_what_is_no_image_mask_or_frame_is_refused_by_name(given, error, says):
    given = {"depth": np.full((480, 640), 0.407, np.float32), "camera": CAMERA, "uncertainty": SIGMA} | given
    with pytest.raises(error, match=rf"^{says}"):
        PLANNER.plan(**given)


def test_networks_that_see_the_depth_image_take_the_papers_camera():
    depth = seen(CAMERA, placed((0.03, 0.0), 0.0)[0])
    shapes = []

    def records(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        shapes.append(inputs.shape)
        return np.ones(grid.SHAPE, np.float32), np.full(grid.SHAPE, 5, np.uint8)

    planner = dataclasses.replace(PLANNER, predict=records, input="depth")
    grasp = planner.plan(depth, CAMERA, SIGMA)
    assert isinstance(grasp, Grasp) and grasp.table is None and shapes == [(1, 132, 176)]
    with pytest.raises(PlanningError, match="pose is unknown"):
        planner.plan(depth, CAMERA, SIGMA, posed=False)
    with pytest.raises(DepthError, match="takes the paper's"):
        planner.plan(depth, CAMERA.at(straight_down(0.5)), SIGMA)


def test_a_planner_is_loaded_from_a_models_folder_or_a_networks(tmp_path):
    """Of a network's folder torch runs the network, and what else is needed has to be given."""
    params = PARAMS.network["fcn"]
    network = build_network(params).eval()
    torch.nn.init.normal_(network.output.weight, std=0.5, generator=torch.Generator().manual_seed(0))
    save_model(tmp_path / "model", network, params)
    depth = seen(CAMERA, placed((0.03, 0.0), 0.0)[0])
    grasps = [GraspPlanner.load(tmp_path / "model").plan(depth, CAMERA, SIGMA) for _ in range(2)]
    np.testing.assert_array_equal(grasps[0].q, grasps[1].q)
    save_network(tmp_path / "network", network, params)
    with pytest.raises(ModelError, match=r"config.json: format: missing; `graspfn model export`"):
        GraspPlanner.load(tmp_path / "network")
    given = GraspPlanner.load(tmp_path / "network", GRIPPER, PARAMS.table, PARAMS.plan)
    np.testing.assert_allclose(given.plan(depth, CAMERA, SIGMA).q, grasps[0].q, atol=1e-4)
    with pytest.raises(WeightsError):
        GraspPlanner.load(tmp_path / "nothing", GRIPPER, PARAMS.table, PARAMS.plan)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"format": FORMAT + 1}, "format: is 2; this graspfn reads 1 to 1"),
        ({"format": "new"}, "format: is 'new'"),
        ({"grid": GRID | {"cell_m": 0.02}}, "grid: is {.*this graspfn plans on"),
        ({"camera": {}}, "camera.fewest_px: takes a number above 0, not None"),
        ({"camera": 3}, "camera.fewest_px"),
        ({"training": {"meshes": {"size_max_cm": "20"}}}, "training.meshes.size_max_cm: takes a number above 0"),
        ({"gripper": {"name": "hand"}}, "gripper.joints: missing"),
        ({"table": None}, "table: takes a mapping"),
        ({"onnx_sha256": None}, "onnx_sha256: takes the sha256 of network.onnx, not None"),
    ],
)
def test_a_model_that_does_not_fit_is_one_line(tmp_path, changes, says):
    save_model(tmp_path, build_network(PARAMS.network["fcn"]), PARAMS.network["fcn"], **changes)
    with pytest.raises(ValueError, match=rf"config.json: {says}") as caught:
        GraspPlanner.load(tmp_path)
    assert "\n" not in str(caught.value)


def test_a_table_that_is_not_to_be_found_is_believed():
    believed = dataclasses.replace(PLANNER, table=Table(False, 20, 0.15, 3, 100))
    thing, q = placed((0.05, 0.03), 1.1)
    grasp = believed.plan(seen(CAMERA, thing), CAMERA, SIGMA)
    assert grasp.table is None
    np.testing.assert_allclose(grasp.q[:2], q[:2], atol=0.003)
