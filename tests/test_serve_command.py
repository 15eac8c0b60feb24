"""`graspfn serve`: over HTTP the answers of `graspfn plan`, for many at once, and a line for whatever else comes in."""

from __future__ import annotations

import http.client
import io
import json
import socket
import struct
import subprocess
import sys
import threading
import time
import types
import zlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
import pytest
import typer
import uvicorn
from made_models import save_model
from PIL import Image
from test_imaging_camera import orbited
from test_plan_command import CAMERA, DEPTH, EMPTY, PARAMS, network  # noqa: F401
from test_planning_planner import placed, rigid, seen
from typer.testing import CliRunner

from graspfn.cli import app
from graspfn.commands import depth_pixels, served
from graspfn.imaging.camera import straight_down
from graspfn.planning.model import DEFAULT
from graspfn.planning.planner import GraspPlanner
from graspfn.robot import messages

ROOT = Path(__file__).parents[1]
FX, FY, CX, CY = CAMERA.K
LENS = {"fx": FX, "fy": FY, "cx": CX, "cy": CY}
OPTIONS = LENS | {"sigma_uv_mm": 5, "sigma_theta_deg": 10}


@contextmanager
def serving(application) -> Iterator[int]:
    """The port of a server that runs meanwhile."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        server = uvicorn.Server(uvicorn.Config(application, log_level="critical", ws="none"))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        try:
            while not server.started:
                time.sleep(0.01)
            yield listening.getsockname()[1]
        finally:
            server.should_exit = True
            thread.join()


@pytest.fixture(scope="module")
def folder(tmp_path_factory, network) -> Path:  # noqa: F811
    folder = tmp_path_factory.mktemp("serve") / "model"
    save_model(folder, network, PARAMS.network["fcn"])
    return folder


@pytest.fixture(scope="module")
def port(folder) -> Iterator[int]:
    with serving(served.app((folder, GraspPlanner.load(folder)))) as port:
        yield port


def ask(port: int, method: str, target: str, body: bytes = b"", kind: str | None = None) -> tuple[int, dict]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    try:
        connection.request(method, target, body, {} if kind is None else {"Content-Type": kind})
        response = connection.getresponse()
        text = response.read().decode()
        return response.status, json.loads(text) if "json" in response.headers["Content-Type"] else {"text": text}
    finally:
        connection.close()


def post(port: int, body: bytes, kind: str = "application/x-npy", /, **options: object) -> tuple[int, dict]:
    return ask(port, "POST", f"/plan?{urlencode(options)}", body, kind)


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def png(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(array).save(stream, "PNG")
    return stream.getvalue()


def row(matrix: np.ndarray) -> str:
    return ",".join(repr(value) for value in matrix.ravel().tolist())


def by_command(folder: Path, image: Path, options: dict[str, object], files: Path) -> dict:
    """What `graspfn plan` answers to the same; its matrices stand in files."""
    arguments = [str(image), "--model", str(folder), "--json"]
    for name, value in options.items():
        if name in ("covariance", "camera_pose", "robot_from_gripper", "gripper_from_camera"):
            (files / name).write_text(str(value))
            value = files / name
        arguments += [f"--{name.replace('_', '-')}", str(value)]
    return json.loads(CliRunner().invoke(app, ["plan", *arguments]).stdout)


def test_the_answer_is_that_of_the_command(folder, port, tmp_path):
    rng = np.random.default_rng(0)
    T = straight_down(0.4)
    T[0, 3] = 0.02
    correlated = np.array([[4e-5, 1e-5, 1e-4], [1e-5, 3e-5, 0], [1e-4, 0, 0.03]])
    frames = {"robot_from_gripper": row(rigid(rng)), "gripper_from_camera": row(rigid(rng))}
    tilted = seen(CAMERA.at(orbited(0.45, 30)), placed((0.0, 0.0), 0.3)[0])
    asked = [
        (DEPTH, OPTIONS),
        (DEPTH, OPTIONS | frames),
        (DEPTH, LENS | {"covariance": row(correlated)}),
        (DEPTH, LENS | {"method": "centroid"}),
        (DEPTH, OPTIONS | {"camera_pose": row(T), "method": "best"}),
        (DEPTH, OPTIONS | {"depth_unit": "m", "roi": "0,0,640,470"}),
        (DEPTH, OPTIONS | {"min_score": 1}),
        (EMPTY, OPTIONS),
        (tilted, OPTIONS),
    ]
    for number, (depth, options) in enumerate(asked):
        np.save(tmp_path / "image.npy", depth)
        expected = by_command(folder, tmp_path / "image.npy", options, tmp_path)
        status, told = post(port, npy(depth), **options)
        assert status == 200, told
        assert told == expected | {"image": "body"}, number
    millimetres = np.rint(np.nan_to_num(DEPTH) * 1000).astype(np.uint16)
    Image.fromarray(millimetres).save(tmp_path / "image.png")
    expected = by_command(folder, tmp_path / "image.png", OPTIONS, tmp_path)
    assert post(port, png(millimetres), "image/png", **OPTIONS)[1] == expected | {"image": "body"}
    tenths = OPTIONS | {"depth_unit": "0.1mm"}
    told = post(port, png(millimetres * 10), "image/png", **tenths)[1]
    assert told["table"] == pytest.approx(expected["table"], abs=1e-4)


def test_a_lens_is_taken_as_opencv_has_it(port):
    """What is beside the axis is nearer to it than in a pinhole's image."""
    straight, bent = (
        post(port, npy(DEPTH), **OPTIONS, **lens)[1]["table"] for lens in ({}, {"distortion": "0.5,0,0,0"})
    )
    assert np.hypot(bent["u_m"], bent["v_m"]) < np.hypot(straight["u_m"], straight["v_m"])


def test_answers_do_not_depend_on_what_is_asked_beside_them(port):
    scenes = [npy(seen(CAMERA, placed((0.02 * i, -0.01 * i), i)[0])) for i in range(3)] + [npy(EMPTY), b"no image"]
    alone = [post(port, body, **OPTIONS) for body in scenes]
    assert [status for status, _ in alone] == [200, 200, 200, 200, 400]
    with ThreadPoolExecutor(8) as threads:
        together = list(threads.map(lambda body: post(port, body, **OPTIONS), scenes * 4))
    assert together == alone * 4


def test_it_says_that_it_is_ready_and_what_it_takes(folder, port):
    status, health = ask(port, "GET", "/health")
    assert status == 200 and health["status"] == "ready" and health["model"] == str(folder) and health["version"]
    _, described = ask(port, "GET", "/openapi.json")
    plan = described["paths"]["/plan"]["post"]
    assert set(plan["requestBody"]["content"]) == {"image/png", "application/x-npy"}
    named = {parameter["name"] for parameter in plan["parameters"]}
    command = typer.main.get_command(app).commands["plan"]
    apart = {"images", "topic", "mask", "as_json", "figure", "model", "camera"}  # of files, and of the command itself
    assert {parameter.name for parameter in command.params} - apart == named - {"distortion"}
    assert "swagger" in ask(port, "GET", "/docs")[1]["text"]


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"fx": None}, "fx: field required"),
        ({"fx": "wide"}, "fx: input should be a valid number"),
        ({"fx": "nan"}, "fx nan: takes pixels"),
        ({"fy": "inf"}, "fy inf: takes pixels"),
        ({"cx": "nan"}, "cx nan: takes pixels"),
        ({"fx": "1e-300"}, "fx 1e-300: takes pixels"),
        ({"sigma_uv": 5}, "sigma_uv: no such option"),
        ({"sigma_uv_mm": None}, "sigma_uv_mm: missing"),
        ({"sigma_uv_mm": "nan"}, "sigma_uv_mm nan: takes a finite number"),
        ({"sigma_uv_mm": "1e300"}, "sigma_uv_mm, sigma_theta_deg: sigma_uv: is 1e+297 m"),
        ({"covariance": "1 0 0 0 1 0 0 0 1"}, "covariance: takes no sigma_uv_mm and sigma_theta_deg beside it"),
        ({"sigma_uv_mm": None, "sigma_theta_deg": None, "covariance": "1 2"}, "covariance: has 2 numbers; it takes 9"),
        ({"sigma_uv_mm": None, "sigma_theta_deg": None, "covariance": row(-np.eye(3))}, "covariance: covariance: the"),
        ({"distortion": "0.1,0.2"}, "distortion: has 2 numbers"),
        ({"distortion": "a,b,c,d"}, "distortion: could not convert"),
        ({"distortion": "nan,0,0,0"}, "distortion: has 4 numbers; it takes 4, 5 or 8 finite"),
        ({"camera_pose": row(np.eye(4))}, "camera_pose: takes a camera that looks down"),
        ({"camera_pose": row(2 * np.eye(4))}, "camera_pose: takes a rigid transform"),
        ({"robot_from_gripper": row(np.eye(4))}, "gripper_from_camera: missing; it takes both"),
        (
            {"robot_from_gripper": row(np.full((4, 4), np.nan))},
            "robot_from_gripper: has 16 numbers; it",
        ),
        ({"depth_unit": "cm"}, "depth_unit: input should be 'mm', '0.1mm' or 'm'"),
        ({"depth_unit": "mm"}, "body: depth_unit mm has the middle of its depths at 0.000407 m, where no table is"),
        ({"method": "better"}, "method: input should be 'robust', 'best' or 'centroid'"),
        ({"roi": "1,2,3"}, "roi 1,2,3: takes four whole numbers"),
        ({"roi": "600,0,100,100"}, "body: roi: (600, 0, 100, 100) is not within the image"),
        ({"roi": f"{'9' * 5000},0,1,1"}, "roi 99999"),
        ({"min_score": 2}, "min_score 2: takes a number from 0 to 1"),
    ],
)
def test_a_wrong_option_is_one_line_that_names_it(port, changes, says):
    options = {name: value for name, value in (OPTIONS | changes).items() if value is not None}
    status, told = post(port, npy(DEPTH), **options)
    assert status == 400 and list(told) == ["image", "error"]
    assert told["error"].startswith(says) and "\n" not in told["error"], told["error"]
    assert "--" not in told["error"]


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def claiming(width: int, height: int, data: bytes = b"") -> bytes:
    """A PNG of 16 bits that says it has so many pixels."""
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")


def header(text: str, version: bytes = b"\x01\x00") -> bytes:
    size = struct.pack("<H" if version[0] == 1 else "<I", len(text))
    return b"\x93NUMPY" + version + size + text.encode("latin1")


def pickled() -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.array([[print, 1]], dtype=object), allow_pickle=True)
    return stream.getvalue()


def zipped() -> bytes:
    stream = io.BytesIO()
    np.savez(stream, DEPTH)
    return stream.getvalue()


SHAPE = "{'descr': '<f4', 'fortran_order': False, 'shape': %s}\n"
ROWS = b"\0" + bytes(2 * 8)


@pytest.mark.parametrize(
    ("kind", "body", "says"),
    [
        ("npy", b"", "body: cannot be read as .npy"),
        ("png", b"", "body: cannot be read as .png: it is none"),
        ("npy", png(np.full((9, 9), 500, np.uint16)), "body: cannot be read as .npy"),
        ("png", npy(DEPTH), "body: cannot be read as .png: it is none"),
        ("npy", pickled(), "body: is of object"),
        ("npy", zipped(), "body: cannot be read as .npy"),
        ("npy", npy(DEPTH)[:-1], "body: cannot be read as .npy: it ends after"),
        ("npy", header(SHAPE % "(2000000000, 2000000000)"), "body: has 2000000000 x 2000000000 pixels; it takes up to"),
        ("npy", header(SHAPE % "(4096, 4096)") + bytes(9), "body: has 4096 x 4096 pixels"),
        ("npy", header(SHAPE % "(-4, -4)"), "body: has the shape (-4, -4)"),
        ("npy", header(SHAPE % "(4, 4, 4)"), "body: has the shape (4, 4, 4)"),
        ("npy", header(SHAPE % ("(" * 3000)), "body: cannot be read as .npy"),
        ("npy", header(" " * 60000 + SHAPE % "(4, 4)"), "body: cannot be read as .npy: Header info length"),
        ("npy", header(" " * 70000 + SHAPE % "(4, 4)", b"\x02\x00"), "body: cannot be read as .npy: Header info"),
        ("npy", header(SHAPE % "(4, 4)", b"\x03\x00"), "body: cannot be read as .npy: format 3.0; it takes 1.0 or 2.0"),
        ("npy", b"\x93NUMPY\x02\x00\xff\xff\xff\xff", "body: cannot be read as .npy"),
        ("npy", header("__import__('os').system('true')\n"), "body: cannot be read as .npy"),
        ("npy", npy(np.zeros((4, 4), complex)), "body: is of complex128"),
        ("npy", npy(np.full((4, 4), np.nan)), "body: no pixel holds a depth"),
        ("npy", npy(np.full((4, 4), 1e300)), "body: no pixel holds a depth"),
        ("png", claiming(8, 8, 3 * ROWS), "body: no pixel holds a depth"),
        ("png", claiming(0, 8), "body: cannot be read as .png"),
        ("png", claiming(8192, 8192), "body: has 8192 x 8192 pixels; it takes up to"),
        ("png", claiming(12000, 12000), "body: cannot be read as .png: Image size"),  # Pillow's own warning
        ("png", claiming(1 << 30, 1 << 30), "body: cannot be read as .png: Image size"),
        ("png", png(np.zeros((4, 4), np.uint8)), "body: is of uint8"),
        ("png", png(np.zeros((4, 4, 3), np.uint8)), "body: has the shape (4, 4, 3)"),
    ],
)
def test_what_is_no_depth_image_is_one_line(port, kind, body, says):
    status, told = post(port, body, {"npy": "application/x-npy", "png": "image/png"}[kind], **OPTIONS)
    assert status == 400 and told["image"] == "body"
    assert told["error"].startswith(says) and "\n" not in told["error"], told["error"]
    assert "0x" not in told["error"]  # nothing of the server's memory


def test_no_damage_to_an_image_is_a_fault(folder):
    """Bytes changed and ends cut off, by chance: either it is an image still, or a line says why not."""
    rng, bodies = np.random.default_rng(0), {".npy": npy(DEPTH), ".png": png((DEPTH * 1000).astype(np.uint16))}
    for suffix, body in bodies.items():
        for _ in range(150):
            damaged = np.frombuffer(body, np.uint8).copy()
            at = rng.integers(min(len(body), 200 if rng.random() < 0.8 else len(body)), size=rng.integers(1, 4))
            damaged[at] = rng.integers(256, size=len(at))
            cut = damaged[: rng.integers(len(body))] if rng.random() < 0.2 else damaged
            try:
                pixels = depth_pixels.read_pixels(io.BytesIO(cut.tobytes()), suffix, "body")
                assert pixels.ndim == 2
            except served.InputError as error:
                assert "\n" not in str(error)


def test_what_is_too_large_hears_so(port, monkeypatch):
    monkeypatch.setattr(served, "MOST_BYTES", 100_000)
    status, told = post(port, npy(DEPTH), **OPTIONS)
    assert (status, told["error"]) == (413, "body: is larger than the 100000 bytes that are taken")
    assert post(port, png((DEPTH * 1000).astype(np.uint16)[::4, ::4]), "image/png", **OPTIONS)[0] == 200


def test_what_never_ends_is_not_waited_for(port, monkeypatch):
    monkeypatch.setattr(served, "SECONDS", 0.2)
    head = f"POST /plan?{urlencode(OPTIONS)} HTTP/1.1\r\nHost: x\r\n"
    head += "Content-Type: image/png\r\nContent-Length: 99\r\n\r\n"
    with socket.create_connection(("127.0.0.1", port), timeout=20) as slow:
        slow.sendall(head.encode())
        assert slow.recv(4096).startswith(b"HTTP/1.1 408")
    with socket.create_connection(("127.0.0.1", port), timeout=20) as gone:
        gone.sendall(f"{head}abc".encode())
    assert ask(port, "GET", "/health")[0] == 200


def test_what_is_asked_otherwise_is_a_line_too(port):
    target = f"/plan?{urlencode(OPTIONS)}"
    for kind in (None, "image/jpeg", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x"):
        status, told = ask(port, "POST", target, npy(DEPTH), kind)
        assert status == 415 and told["error"].endswith("takes one of image/png, application/x-npy")
    assert ask(port, "GET", target)[0] == 405 and ask(port, "GET", "/")[0] == 404
    status, told = post(port, npy(DEPTH), **OPTIONS, roi="0,0,9,9")
    assert ask(port, "POST", f"{target}&fx=1", npy(DEPTH), "application/x-npy")[1]["error"].startswith("fx: is given 2")


def test_a_fault_of_our_own_shows_nothing_of_itself(folder):
    class Broken:
        def plan(self, *_, **__):
            raise RuntimeError("secret")

    with serving(served.app((folder, Broken()))) as port:
        status, told = post(port, npy(DEPTH), **OPTIONS)
    assert (status, told["error"]) == (500, "a fault of graspfn: RuntimeError")


COMMAND = [sys.executable, "-c", "from graspfn.cli import main; main()", "serve"]


def test_the_command_serves_until_it_is_ended(folder):
    with subprocess.Popen([*COMMAND, "--model", str(folder), "--port", "0"], stdout=subprocess.PIPE, text=True) as run:
        try:
            line = run.stdout.readline()
            assert line.startswith(f"{folder}: ready at http://127.0.0.1:")
            port = int(line.partition("/plan;")[0].rpartition(":")[2])
            assert post(port, npy(DEPTH), **OPTIONS)[0] == 200
            taken = subprocess.run(
                [*COMMAND, "--model", str(folder), "--port", str(port)], capture_output=True, text=True
            )
            assert taken.returncode == 2 and taken.stderr.count("\n") == 1
            assert taken.stderr.startswith(f"--host 127.0.0.1 --port {port}: cannot be listened on: ")
        finally:
            run.terminate()
    assert run.returncode is not None


def test_the_ros_node_of_the_documentation_gets_the_same_answer(port, monkeypatch):
    """With ROS faked: its messages hold what the robot room's do."""
    text = (ROOT / "docs/planning.md").read_text(encoding="utf-8")
    code = next(part for part in text.split("```python\n")[1:] if "rclpy" in part).partition("```")[0]
    subscribed = {}
    node = types.SimpleNamespace(create_subscription=lambda kind, topic, call, depth: subscribed.update({kind: call}))
    ros = types.SimpleNamespace(init=lambda: None, create_node=lambda name: node, spin=lambda node: None)
    kinds = types.SimpleNamespace(CameraInfo="CameraInfo", Image="Image")
    for name, module in {"rclpy": ros, "sensor_msgs": types.SimpleNamespace(), "sensor_msgs.msg": kinds}.items():
        monkeypatch.setitem(sys.modules, name, module)
    said = []
    scope = {"print": said.append}
    exec(compile(code, "planning.md", "exec"), scope)
    scope["URL"] = f"http://127.0.0.1:{port}/plan?"
    scope["main"]()
    header = messages.header(1, "camera")
    image = types.SimpleNamespace(**messages.depth_image(DEPTH, "16UC1", header))
    subscribed["Image"](image)  # before the camera is known
    info = messages.camera_info(CAMERA.matrix, DEPTH.shape, header)
    subscribed["CameraInfo"](types.SimpleNamespace(**info))
    subscribed["Image"](image)
    subscribed["Image"](types.SimpleNamespace(**messages.depth_image(DEPTH, "32FC1", header)))
    millimetres = np.rint(np.nan_to_num(DEPTH) * 1000).astype(np.uint16)
    assert said == [post(port, npy(pixels), **OPTIONS)[1] for pixels in (millimetres, DEPTH)]


def test_without_a_model_there_is_nothing_to_serve():
    result = CliRunner().invoke(app, ["serve", "--model", "nothing"])
    assert result.exit_code == 2 and result.stderr.count("\n") == 1
    assert result.stderr.startswith("--model nothing: no such folder")


def test_the_model_that_comes_along_is_served_unless_another_is_asked_for(monkeypatch):
    seen = []
    monkeypatch.setattr(served, "run", lambda model, host, port: seen.append((model[0], host, port)))
    assert CliRunner().invoke(app, ["serve"]).exit_code == 0
    assert seen == [(Path(DEFAULT.name), "127.0.0.1", 8765)]


def test_where_the_extra_is_not_installed_the_line_says_which(monkeypatch):
    monkeypatch.setitem(sys.modules, "fastapi", None)
    monkeypatch.delitem(sys.modules, "graspfn.commands.served")
    monkeypatch.delattr("graspfn.commands.served")
    result = CliRunner().invoke(app, ["serve"])
    assert result.exit_code == 2 and "pip install 'graspfn[serve]'" in result.stderr
