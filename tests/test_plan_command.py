"""`graspfn plan`: depth images as people have them, a line of JSON for each, exit statuses, one line for bad input."""

from __future__ import annotations

import io
import json
import shutil
from pathlib import Path

import made_bags
import numpy as np
import pytest
import torch
import yaml
from made_models import save_model
from mcap_ros2.writer import Writer
from physics_params import PARAMS
from PIL import Image
from scipy.spatial.transform import Rotation
from test_imaging_camera import orbited
from test_planning_planner import CAMERA, block, placed, rigid, seen
from typer.testing import CliRunner

from graspfn.cli import app
from graspfn.imaging.camera import straight_down
from graspfn.learning.networks import GraspNetwork, build_network
from graspfn.planning.model import DEFAULT
from graspfn.planning.planner import GraspPlanner
from graspfn.planning.uncertainty import PoseUncertainty
from graspfn.robot import messages
from graspfn.robot.analyse import Measured
from graspfn.robot.covariance_file import write_covariance
from graspfn.robot.spread import spread

FX, FY, CX, CY = CAMERA.K
PINHOLE = ["--fx", str(FX), "--fy", str(FY), "--cx", str(CX), "--cy", str(CY)]
SIGMA = ["--sigma-uv-mm", "5", "--sigma-theta-deg", "10"]
OPTIONS = ["--model", "model", *PINHOLE, *SIGMA]
DEPTH = np.round(seen(CAMERA, placed((0.03, -0.02), 0.6)[0]), 3).astype(np.float32)  # as millimetres hold it
EMPTY = np.round(seen(CAMERA, block(0, 0, height=0.002)), 3).astype(np.float32)


def write_mcap(path: Path, topic: str = "/camera/depth/image", **info: object) -> None:
    header = messages.header(1, "camera")
    sent = {
        topic: ("sensor_msgs/msg/Image", messages.depth_image(DEPTH, "16UC1", header)),
        "/camera/depth/camera_info": (
            "sensor_msgs/msg/CameraInfo",
            messages.camera_info(CAMERA.matrix, DEPTH.shape, header) | info,
        ),
    }
    with path.open("wb") as stream:
        writer = Writer(stream)
        for name, (kind, message) in sent.items():
            writer.write_message(name, writer.register_msgdef(kind, messages.SCHEMAS[kind]), message, log_time=1)
        writer.finish()


def write_pcd(path: Path, kind: str) -> None:
    """With what drivers put between and behind the coordinates."""
    points = (CAMERA.camera_rays() * DEPTH[..., None]).reshape(-1, 3).astype(np.float32)
    header = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z _ rgb\nSIZE 4 4 4 1 4\nTYPE F F F U U\nCOUNT 1 1 1 4 1\n"
    header += f"WIDTH 640\nHEIGHT 480\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA {kind}\n"
    if kind == "ascii":
        np.savetxt(path, np.pad(points, ((0, 0), (0, 5))), "%.9g", header=header.rstrip(), comments="")
        return
    cloud = np.zeros(len(points), [("xyz", "<f4", 3), ("_", "u1", 4), ("rgb", "<u4")])
    cloud["xyz"] = points
    path.write_bytes(header.encode() + cloud.tobytes())


@pytest.fixture(scope="module")
def network() -> GraspNetwork:
    """Of chance: it finds some poses better than others."""
    network = build_network(PARAMS.network["fcn"]).eval()
    torch.nn.init.normal_(network.output.weight, std=0.5, generator=torch.Generator().manual_seed(0))
    return network


@pytest.fixture
def workplace(tmp_path, monkeypatch, network):
    monkeypatch.chdir(tmp_path)
    save_model(tmp_path / "model", network, PARAMS.network["fcn"])
    np.save("object.npy", DEPTH)
    np.save("empty.npy", EMPTY)
    return tmp_path


def plan(*arguments: str):
    return CliRunner().invoke(app, ["plan", *arguments])


def planned(*arguments: str) -> dict:
    result = plan(*arguments, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_every_format_gives_the_same_grasp(workplace):
    millimetres = np.rint(np.nan_to_num(DEPTH) * 1000).astype(np.uint16)
    Image.fromarray(millimetres).save("mm.png")
    Image.fromarray(millimetres * 10).save("tenths.png")
    Image.fromarray(millimetres).save("mm.tiff")
    Image.fromarray(DEPTH).save("metres.tif")
    write_pcd(Path("binary.pcd"), "binary")
    write_pcd(Path("ascii.pcd"), "ascii")
    write_mcap(Path("recording.mcap"))
    expected = planned("object.npy", *OPTIONS)
    own = ["--model", "model", *SIGMA]
    for name, options in {
        "mm.png": OPTIONS,
        "tenths.png": [*OPTIONS, "--depth-unit", "0.1mm"],
        "mm.tiff": OPTIONS,
        "metres.tif": OPTIONS,
        "binary.pcd": own,
        "ascii.pcd": own,
        "recording.mcap": own,
    }.items():
        told = planned(name, *options)
        assert told.pop("image") == name
        for part, values in told.items():
            if isinstance(values, dict):
                assert values == pytest.approx(expected[part], abs=1e-4), name
    assert planned("recording.mcap", *own, "--topic", "/camera/depth/image")["table"] == told["table"]


def test_the_line_says_what_the_planner_found(workplace):
    rng = np.random.default_rng(1)
    T_robot_gripper, T_gripper_camera = rigid(rng), rigid(rng)
    np.savetxt("arm.txt", T_robot_gripper)
    x, y, z, w = Rotation.from_matrix(T_gripper_camera[:3, :3]).as_quat().tolist()
    shift = dict(zip("xyz", T_gripper_camera[:3, 3].tolist(), strict=True))
    turn = {"x": x, "y": y, "z": z, "w": w}
    Path("hand.yaml").write_text(yaml.safe_dump({"transform": {"translation": shift, "rotation": turn}}))
    frames = ["--robot-from-gripper", "arm.txt", "--gripper-from-camera", "hand.yaml"]
    told = planned("object.npy", *OPTIONS, *frames)
    grasp = GraspPlanner.load(Path("model")).plan(
        DEPTH,
        CAMERA,
        PoseUncertainty.of(5, 10),
        posed=False,
        T_robot_gripper=T_robot_gripper,
        T_gripper_camera=T_gripper_camera,
    )
    assert list(told["table"].values()) == [*grasp.q, grasp.z_m]
    assert list(told["pixels"].values()) == list(grasp.pixel)
    assert (told["score"], told["robust_score"]) == (grasp.score, grasp.robust_score)
    np.testing.assert_allclose(told["robot"]["position_m"], grasp.T_robot_grasp[:3, 3], atol=1e-9)
    turned = Rotation.from_quat(told["robot"]["quaternion_xyzw"]).as_matrix()
    np.testing.assert_allclose(turned, grasp.T_robot_grasp[:3, :3], atol=1e-9)
    fit = {"tilt_deg", "height_m", "inliers", "rms_m"}
    assert set(told["table_fit"]) == fit and told["model"] == "model"
    words = plan("object.npy", *OPTIONS, *frames).stdout
    assert f"promises {grasp.robust_score:.2f}" in words and "robot  (" in words


def test_a_cameras_pose_says_where_the_tables_origin_is(workplace):
    """Shifted by 2 cm along u, so that the object is 2 cm further back; without it, the origin is on the axis."""
    T = straight_down(0.4)
    T[0, 3] = 0.02
    np.savetxt("pose.txt", T, delimiter=",", header="T_world_camera")
    here, there = (planned("object.npy", *OPTIONS, *more)["table"] for more in ([], ["--camera-pose", "pose.txt"]))
    assert there["u_m"] - here["u_m"] == pytest.approx(0.02, abs=0.004)


def test_cameras_as_ros_writes_them(workplace):
    expected = planned("object.npy", *OPTIONS)
    K = [FX, 0.0, CX, 0.0, FY, CY, 0.0, 0.0, 1.0]
    roi = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
    echo = {"header": {"frame_id": "camera"}, "height": 480, "width": 640, "distortion_model": "plumb_bob"}
    echo |= {"d": [0.0] * 5, "k": K, "r": [1.0], "p": K, "binning_x": 0, "binning_y": 0, "roi": roi}
    Path("echo.yaml").write_text(yaml.safe_dump(echo) + "---\n" + yaml.safe_dump(echo) + "---\n")
    calibration = {"image_width": 640, "image_height": 480, "camera_name": "depth", "distortion_model": "plumb_bob"}
    calibration |= {"camera_matrix": {"rows": 3, "cols": 3, "data": K}}
    calibration |= {"distortion_coefficients": {"rows": 1, "cols": 5, "data": [0, 0, 0, 0, 0]}}
    Path("calibration.yaml").write_text(yaml.safe_dump(calibration))
    for name in ("echo.yaml", "calibration.yaml"):
        assert planned("object.npy", "--model", "model", "--camera", name, *SIGMA) == expected
    echo |= {"distortion_model": "equidistant", "d": [0.1, 0.01, 0.0, 0.0]}
    Path("fisheye.yaml").write_text(yaml.safe_dump(echo))
    refused(
        "--camera fisheye.yaml: distortion_model 'equidistant'; it takes plumb_bob", camera=["--camera", "fisheye.yaml"]
    )
    del echo["k"]
    Path("none.yaml").write_text(yaml.safe_dump(echo))
    refused("--camera none.yaml: K: missing", camera=["--camera", "none.yaml"])
    Path("small.yaml").write_text(yaml.safe_dump(calibration | {"image_width": 320}))
    refused(
        "--camera small.yaml: camera of 320x480 pixels; the depth image has 640x480", camera=["--camera", "small.yaml"]
    )


def test_every_image_gets_a_line_whatever_is_wrong_with_others(workplace):
    result = plan("object.npy", "none.npy", "empty.npy", *OPTIONS, "--json", "--figure", "plans.png")
    lines = [json.loads(line) for line in result.stdout.splitlines()]
    assert [line["image"] for line in lines] == ["object.npy", "none.npy", "empty.npy"]
    assert "robust_score" in lines[0] and lines[1]["error"].startswith("none.npy: cannot be read")
    assert lines[2]["no_grasp"].startswith("no object") and lines[2]["table_fit"]["height_m"] > 0.3
    assert result.exit_code == 2 and result.stderr == lines[1]["error"] + "\n"
    for name in ("plans-object.png", "plans-empty.png"):
        assert np.asarray(Image.open(name).convert("L")).std() > 5
    assert not Path("plans-none.png").exists()
    assert plan("object.npy", "empty.npy", *OPTIONS).exit_code == 3
    result = plan("empty.npy", *OPTIONS)
    assert result.exit_code == 3 and result.stdout.startswith("empty.npy: no grasp: no object")
    assert "min_score takes 1" in plan("object.npy", *OPTIONS, "--min-score", "1").stdout


def test_a_tilted_camera_beyond_the_models_limit_is_no_grasp(workplace):
    np.save("tilted.npy", seen(CAMERA.at(orbited(0.45, 30)), placed((0.0, 0.0), 0.3)[0]))
    result = plan("tilted.npy", *OPTIONS, "--json")
    assert result.exit_code == 3 and "table.max_tilt_deg takes 20" in json.loads(result.stdout)["no_grasp"]


def test_what_needs_no_uncertainty_takes_none_and_a_covariance_does_as_well(workplace):
    base = ["object.npy", "--model", "model", *PINHOLE]
    best = planned(*base, "--method", "best")
    assert best["score"] == best["robust_score"]
    np.savetxt("sigma.txt", np.diag([0.005, 0.005, np.radians(10)]) ** 2)
    robust, other = planned(*base, "--covariance", "sigma.txt"), planned(*base, *SIGMA)
    assert robust["table"] == pytest.approx(other["table"]) and robust["robust_score"] == pytest.approx(
        other["robust_score"]
    )


def test_sigma_of_recordings_plans_as_it_is_written(workplace):
    """In mm and degrees, with the correlations that were measured."""
    errors = np.random.default_rng(0).standard_normal((40, 3)) @ np.array([[6, 3, 0], [0, 5, 0], [1, 0, 9]])
    found = spread(errors)
    write_covariance(Path("measured.yaml"), Measured("6.2 mm, 4.7° assumed", found, ()))
    scale = np.array([1e-3, 1e-3, np.pi / 180])
    np.savetxt("sigma.txt", found.covariance * np.outer(scale, scale))
    base = ["object.npy", "--model", "model", *PINHOLE, "--covariance"]
    told, same = planned(*base, "measured.yaml"), planned(*base, "sigma.txt")
    assert told["table"] == pytest.approx(same["table"]) and told["robust_score"] == pytest.approx(same["robust_score"])
    Path("measured.yaml").write_text("covariance: 3\n")
    result = plan(*base, "measured.yaml")
    assert (
        result.stderr == "--covariance measured.yaml: takes YAML with units and a covariance of 3 rows of 3 numbers\n"
    )


def test_a_region_and_a_mask_restrict_the_view(workplace):
    np.save("two.npy", seen(CAMERA, placed((0.07, 0.02), 0.4)[0], block(-0.1, -0.1)))
    assert plan("two.npy", *OPTIONS).exit_code == 3
    x, y = CAMERA.table_to_pixel(np.array([0.07, 0.02])).round().astype(int)
    mask = np.zeros(DEPTH.shape, dtype=np.uint8)
    mask[y - 160 : y + 160, x - 160 : x + 160] = 255
    Image.fromarray(mask).save("mask.png")
    region = planned("two.npy", *OPTIONS, "--roi", f"{x - 160},{y - 160},320,320")
    assert planned("two.npy", *OPTIONS, "--mask", "mask.png") == region


def refused(
    says: str, image: str = "object.npy", camera: list[str] | None = None, more: list[str] | None = None
) -> None:
    result = plan(image, "--model", "model", *(PINHOLE if camera is None else camera), *SIGMA, *(more or []))
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith(says), result.stderr
    assert result.stderr.count("\n") == 1 and not result.stdout


@pytest.mark.parametrize(
    ("write", "says"),
    [
        (
            {"mm": 4000},
            "d.png: --depth-unit mm has the middle of its depths at 4 m, where no table is; --depth-unit 0.1mm",
        ),
        ({"mm": 4}, "d.png: --depth-unit mm has the middle of its depths at 0.004 m"),
        ({"mm": 0}, "d.png: no pixel holds a depth"),
        (
            {"mm": 400, "unit": "m"},
            "d.png: --depth-unit m has the middle of its depths at 400 m, where no table is; --depth-unit mm",
        ),
    ],
)
def test_a_unit_that_puts_no_table_under_the_camera_is_questioned(workplace, write, says):
    Image.fromarray(np.full((480, 640), write["mm"], np.uint16)).save("d.png")
    refused(says, "d.png", more=["--depth-unit", write["unit"]] if "unit" in write else [])


@pytest.mark.parametrize(
    ("image", "camera", "more", "says"),
    [
        ("photo.jpg", None, [], "photo.jpg: takes a depth image: .png"),
        ("none.png", None, [], "none.png: cannot be read: No such file"),
        ("text.png", None, [], "text.png: cannot be read as .png"),
        ("text.pcd", None, [], "text.pcd: no .pcd file"),
        ("flat.pcd", None, [], "flat.pcd: not organised"),
        ("text.mcap", None, [], "text.mcap: not an MCAP file"),
        ("colour.png", None, [], "colour.png: has the shape (4, 4, 3)"),
        ("eight.png", None, [], "eight.png: is of uint8"),
        ("object.npy", [], [], "object.npy: --camera: missing"),
        ("object.npy", ["--fx", "500"], [], "--fy: missing; it takes all of --fx --fy --cx --cy"),
        ("object.npy", ["--fx", "0", "--fy", "5", "--cx", "5", "--cy", "5"], [], "--fx 0: takes pixels"),
        ("object.npy", ["--camera", "text.png"], [], "--camera text.png: takes a CameraInfo"),
        ("object.npy", ["--camera", "none.yaml"], [], "--camera none.yaml: cannot be read"),
        ("object.npy", ["--camera", "none.yaml", *PINHOLE], [], "--fx: takes no --camera beside it"),
        ("object.npy", None, ["--depth-unit", "cm"], "--depth-unit cm: takes one of mm, 0.1mm, m"),
        ("object.npy", None, ["--topic", "/depth"], "--topic /depth: object.npy has no topics"),
        ("object.npy", None, ["--method", "better"], "--method better: takes one of robust, best, centroid"),
        ("object.npy", None, ["--sigma-uv-mm", "-1"], "--sigma-uv-mm -1: takes a finite number"),
        ("object.npy", None, ["--sigma-theta-deg", "nan"], "--sigma-theta-deg nan: takes a finite number"),
        ("object.npy", None, ["--covariance", "nine.txt"], "--covariance nine.txt: takes no --sigma-uv-mm"),
        ("object.npy", None, ["--roi", "1,2,3"], "--roi 1,2,3: takes four whole numbers"),
        ("object.npy", None, ["--roi", "600,0,100,100"], "object.npy: --roi: (600, 0, 100, 100) is not within"),
        ("object.npy", None, ["--mask", "text.png"], "--mask text.png: takes an image"),
        ("object.npy", None, ["--mask", "eight.png"], "object.npy: --mask: has the shape (4, 4)"),
        ("object.npy", None, ["--min-score", "2"], "--min-score 2: takes a number from 0 to 1"),
        ("object.npy", None, ["--figure", "plan.pdf"], "--figure plan.pdf: takes a name that ends in .png"),
        ("object.npy", None, ["--figure", "no/plan.png"], "--figure no/plan.png: no folder no"),
        ("object.npy", None, ["--camera-pose", "text.png"], "--camera-pose text.png: could not convert"),
        ("object.npy", None, ["--camera-pose", "eye.txt"], "--camera-pose eye.txt: takes a camera that looks down"),
        ("object.npy", None, ["--robot-from-gripper", "eye.txt"], "--gripper-from-camera: missing"),
        (
            "object.npy",
            None,
            ["--robot-from-gripper", "twice.txt", "--gripper-from-camera", "eye.txt"],
            "--robot-from-gripper twice.txt: takes a rigid transform",
        ),
        ("object.npy", None, ["--model", "nothing"], "--model nothing: no such folder"),
    ],
)
def test_bad_input_names_its_file_and_option(workplace, image, camera, more, says):
    for name in ("text.png", "text.pcd", "text.mcap"):
        Path(name).write_text("no image")
    Path("flat.pcd").write_text("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nDATA ascii\n0 0 1\n0 1 1\n")
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save("colour.png")
    Image.fromarray(np.zeros((4, 4), np.uint8)).save("eight.png")
    np.savetxt("nine.txt", np.eye(3))
    np.savetxt("eye.txt", np.eye(4))
    np.savetxt("twice.txt", 2 * np.eye(4))
    refused(says, image, camera, more)


def test_what_is_missing_is_named(workplace):
    for options, says in (
        (["--model", "model", *PINHOLE], "--sigma-uv-mm: missing"),
        (["--model", "model", *PINHOLE, "--sigma-uv-mm", "5"], "--sigma-theta-deg: missing"),
    ):
        result = plan("object.npy", *options)
        assert result.exit_code == 2 and result.stderr.startswith(says)


def test_without_a_model_it_is_the_one_that_comes_with_the_package(workplace):
    told = planned("object.npy", *PINHOLE, *SIGMA)
    assert told.pop("model") == "mico-fcn"
    for named in (str(DEFAULT), DEFAULT.name):
        other = planned("object.npy", "--model", named, *PINHOLE, *SIGMA)
        assert other.pop("model") == named and other == told


def test_a_folder_of_ones_own_goes_before_a_model_of_its_name(workplace):
    shutil.copytree("model", DEFAULT.name)
    own = planned("object.npy", *OPTIONS)
    assert planned("object.npy", "--model", DEFAULT.name, *PINHOLE, *SIGMA) == own | {"model": DEFAULT.name}
    result = plan("object.npy", "--model", "mico", *PINHOLE, *SIGMA)
    assert result.stderr == "--model mico: no such folder; it takes a model's, or franka-fcn or mico-fcn\n"


def test_a_recording_whose_topic_is_wrong_says_which_there_are(workplace):
    write_mcap(Path("r.mcap"))
    own = ["--model", "model", *SIGMA]
    result = plan("r.mcap", *own, "--topic", "/depth")
    assert result.stderr.startswith("--topic /depth: r.mcap has no depth image on it; it takes one of ['/cam")
    write_mcap(Path("r.mcap"), d=[0.1, 0.1, 0.0, 0.0], distortion_model="equidistant")
    assert "distortion_model 'equidistant'" in plan("r.mcap", *own).stderr
    whole = Path("r.mcap").read_bytes()
    Path("r.mcap").write_bytes(whole[: len(whole) // 2])
    assert plan("r.mcap", *own).stderr.startswith("r.mcap: cut short")


def test_a_recording_is_read_as_graspfn_logs_reads_it(workplace):
    """Images that were compressed as they were published; a colour image on another topic is none of depths."""
    png = io.BytesIO()
    Image.fromarray(np.rint(np.nan_to_num(DEPTH) * 1000).astype(np.uint16)).save(png, "PNG")
    header = messages.header(1, "camera")
    image = {"header": header, "format": "16UC1; compressedDepth png", "data": bytes(12) + png.getvalue()}
    colour = messages.depth_image(np.zeros((4, 4), np.float32), "16UC1", header) | {"encoding": "rgb8"}
    info = messages.camera_info(CAMERA.matrix, DEPTH.shape, header)
    sent = [("/camera/depth/image/compressedDepth", "CompressedImage", image), ("/colour", "Image", colour)]
    made_bags.write_mcap(
        Path("r.mcap"),
        [
            (1, t, f"sensor_msgs/msg/{kind}", m)
            for t, kind, m in [*sent, ("/camera/depth/camera_info", "CameraInfo", info)]
        ],
        None,
    )
    told = planned("r.mcap", "--model", "model", *SIGMA)
    assert told["table"] == pytest.approx(planned("object.npy", *OPTIONS)["table"], abs=1e-4)
