"""`graspfn params`: conf/ composes to params.yaml, and bad arguments are one line that names the key."""

import dataclasses
import typing
from pathlib import Path

import pytest
import yaml
from dvc.utils.serialize import load_yaml
from hydra.core.global_hydra import GlobalHydra
from typer.testing import CliRunner

from graspfn.cli import app
from graspfn.compose import compose, render
from graspfn.imaging.camera import Camera
from graspfn.imaging.holes import DepthError
from graspfn.imaging.network_input import check_papers
from graspfn.params import ParameterError, Params, validate

ROOT = Path(__file__).parents[1]
CONF = ROOT / "conf"
CHOICES = sorted(f"{path.parent.name}={path.stem}" for path in CONF.glob("*/*.yaml"))
# Choices that cannot know one of their values.
NEEDS = {
    "meshes=folder": "meshes.folder=my/meshes",
    "robot=folder": "robot.folder=my/recordings",
    "compute=cluster": "compute.address=tcp://host:8786",
}
COUNTS = {
    "meshes.train",
    "meshes.test",
    "label.test",
    "evaluate.errors_per_object",
    "disturb.objects",
    "disturb.errors_per_object",
    "training_seeds",
    "augment.samples",
    "pretrain.epochs",
    "train.epochs",
    "robot.objects",
    "robot.placements",
}


def flat(values, prefix=""):
    """{"meshes.train": 20, ...}"""
    out = {}
    for key, value in values.items():
        out |= flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return out


def composed(*overrides):
    return compose(list(overrides), CONF)


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """An empty directory with conf/ in it, as the current one."""
    (tmp_path / "conf").symlink_to(CONF)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_committed_params_are_what_the_defaults_compose_to():
    assert (ROOT / "params.yaml").read_text() == render(composed())


def test_written_file_reads_back_as_composed(workplace):
    result = CliRunner().invoke(app, ["params", "scale=smoke", "physics.friction=0.75", "topics.depth=/my depth"])
    assert (result.exit_code, result.output) == (0, "")
    written = yaml.safe_load((workplace / "params.yaml").read_text())
    assert written == composed("scale=smoke", "physics.friction=0.75", "topics.depth=/my depth")
    assert [path.name for path in workplace.iterdir() if path.name != "conf"] == ["params.yaml"]


@pytest.mark.parametrize("choice", CHOICES)
def test_every_choice_of_every_group_is_valid(choice):
    overrides = [choice, *([NEEDS[choice]] if choice in NEEDS else [])]
    if choice.startswith("camera="):  # the paper's network takes the paper's alone
        overrides.append("networks=[fcn]")
    values = composed(*overrides)
    assert yaml.safe_load(render(values)) == values
    assert isinstance(validate(values), Params)


@pytest.mark.parametrize("choice", NEEDS)
def test_choice_asks_for_what_it_cannot_know(choice):
    key = NEEDS[choice].partition("=")[0]
    with pytest.raises(ParameterError, match=f"^{key}: missing"):
        composed(choice)


def test_values_of_a_choice_reach_the_file():
    assert composed("robot=folder", "robot.folder=a/b")["robot"]["source"] == "folder"
    assert composed("compute=cluster", "compute.address=tcp://h:1")["compute"]["address"] == "tcp://h:1"


@pytest.mark.parametrize("scale", sorted(path.stem for path in CONF.glob("scale/*.yaml")))
def test_scale_changes_counts_only(scale):
    desktop, other = flat(composed("scale=desktop")), flat(composed(f"scale={scale}"))
    assert desktop.keys() == other.keys()
    own = {"scale"} | ({"meshes.source"} if scale == "paper" else set())  # generated objects alone are too alike
    assert {key for key in desktop if desktop[key] != other[key]} <= COUNTS | own
    chosen = yaml.safe_load((CONF / f"scale/{scale}.yaml").read_text())
    assert set(flat({key: value for key, value in chosen.items() if key != "defaults"})) == COUNTS | {"scale"}
    assert other["scale"] == scale


def test_paper_scale_has_the_papers_counts():
    paper = flat(composed("scale=paper"))
    assert [paper[key] for key in ("meshes.train", "meshes.test", "augment.samples")] == [1000, 1000, 1000]
    assert (paper["robot.objects"], paper["robot.placements"]) == (20, 5)
    assert paper["meshes.source"] == "open_objects"
    assert flat(composed("scale=paper", "meshes=ycb"))["meshes.source"] == "ycb"


@pytest.mark.parametrize("choice, names", [("network=fcn", ["fcn"]), ("network=[fcn, alexnet]", ["fcn", "alexnet"])])
def test_networks_follow_the_chosen_ones(choice, names):
    values = composed(choice)
    assert values["networks"] == names
    assert set(values["network"]) == set(names)


@pytest.mark.parametrize(
    "change", ["camera=realsense_d435", "camera=azure_kinect", "camera.height_mm=420", "camera.cx_px=300"]
)
def test_networks_that_see_depth_images_take_the_papers_camera(change):
    validate(composed("camera=ideal"))
    with pytest.raises(
        ParameterError, match=r"network.alexnet.input: depth takes the paper's camera.*leave alexnet out"
    ):
        validate(composed(change))
    validate(composed(change, "networks=[fcn]"))
    validate(composed(change, "network.alexnet.input=height_map"))


@pytest.mark.parametrize(
    "change",
    [
        "camera=carmine109",
        "camera=ideal",
        "camera=realsense_d435",
        "camera=azure_kinect",
        "camera.height_mm=407.3",
        "camera.height_mm=408",
        "camera.cy_px=240",
        "camera.fy_px=571",
        "camera.distortion=[0.01,0,0,0]",
    ],
)
def test_parameters_and_images_take_the_same_cameras_for_the_papers(change):
    """Parameters are read before anything is computed, an image where it is used; both have the rule."""
    camera = Camera.from_params(validate(composed(change, "networks=[fcn]")).camera)
    try:
        check_papers(camera)
    except DepthError:
        with pytest.raises(ParameterError, match=r"network\.alexnet\.input"):
            validate(composed(change))
    else:
        validate(composed(change))


def test_network_files_are_named_after_their_architecture():
    assert all(name == entry["architecture"] for name, entry in composed()["network"].items())


AS_TYPED = [
    "Größe",
    "/data/x(1)",
    "run=3",
    "a,b",
    "#1",
    "a #1",
    "o'neil",
    'say "ah"',
    "$HOME",
    "back\\slash",
    "\\",
    "[a]",
    "{",
]
AS_TYPED += [
    "{a: 1}",
    "null",
    "true",
    "12",
    "1e3",
    "0o17",
    "08",
    ".5",
    "1_0",
    " led",
    "trailing ",
    "a: b",
    "- a",
    "*",
    "&a",
]
AS_TYPED += [
    "!a",
    "%d",
    "@a",
    "`a`",
    "|",
    ">",
    "a\nb",
    "a\tb",
    "\x07",
    "\x85",
    "\u2028",
    "\ufeffa",
    "no\xa0break",
    "on",
    "0x1F",
]
AS_TYPED += [
    ".nan",
    "2020-01-01",
    "1:30",
    "=",
    "<<",
    "folder/",
    "../folder",
    "x" * 90 + " " + "y" * 1200,
    "x(",
    "'",
    "a\\'b",
]


TEXT_KEYS = ["meshes.folder", "robot.folder", "topics.depth", "topics.outcome", "gripper.name", "compute.address"]


def test_text_is_taken_as_it_is_typed(workplace):
    for start in range(0, len(AS_TYPED), 2):
        texts = {key: AS_TYPED[(start + i) % len(AS_TYPED)] for i, key in enumerate(TEXT_KEYS)}
        result = CliRunner().invoke(app, ["params", *(f"{key}={text}" for key, text in texts.items())])
        assert (result.exit_code, result.output) == (0, ""), texts
        file = workplace / "params.yaml"
        for values in (
            yaml.safe_load(file.read_text(encoding="utf-8")),
            load_yaml(str(file)),
        ):  # as we and as DVC read it
            for key, text in texts.items():
                section, name = key.split(".")
                assert values[section][name] == (None if (key, text) == ("compute.address", "null") else text)


def test_null_is_no_address():
    assert composed("compute=cluster", "compute.address=null")["compute"]["address"] is None


@pytest.mark.parametrize("key", ["meshes.folder", "robot.folder"])
def test_a_folder_may_lie_in_the_home_directory(monkeypatch, key):
    monkeypatch.setenv("HOME", "/home/o'neil")
    section, name = key.split(".")
    assert composed(f"{key}=~/x (1)")[section][name] == "/home/o'neil/x (1)"
    assert composed("topics.depth=~/x")["topics"]["depth"] == "~/x"


def test_later_arguments_win_over_groups():
    assert composed("meshes.train=7", "scale=paper")["meshes"]["train"] == 7


def test_composing_leaves_hydra_as_it_was():
    composed()
    assert not GlobalHydra.instance().is_initialized()


@pytest.mark.parametrize(
    "argument, names",
    [
        ("scale=huge", "scale: 'huge' is not one of desktop, paper, smoke"),
        ("scale=", "scale: ''"),
        ("scale=[smoke,paper]", "scale: "),
        ("network=[]", "network: "),
        ("network=[fcn,vgg]", "network: 'vgg'"),
        ("scale", "scale: takes GROUP=CHOICE or KEY=VALUE"),
        ("~camera=carmine109", "~camera"),
        ("camera@lens=carmine109", "camera@lens"),
        ("colour=red", "colour: unknown key"),
        ("camera.focal=570", "camera.focal: unknown key; camera takes width_px, height_px, fx_px, "),
        ("camera.fx_px.x=570", "camera.fx_px: takes float"),
        ("camera.fx_px=wide", "camera.fx_px: takes float, not 'wide'"),
        ("camera.fx_px=nan", "camera.fx_px: takes float"),
        ("meshes.train=1.5", "meshes.train: takes int, not 1.5"),
        ("meshes.train=true", "meshes.train: takes int, not True"),
        ("noise.sigma_p_px=-1", "noise.sigma_p_px: "),
        ("evaluate.sigma_uv_mm=[5,-10]", "evaluate.sigma_uv_mm: "),
        ("evaluate.sigma_uv_mm=5", "evaluate.sigma_uv_mm: takes a list"),
        ("robot.sigma_uv_mm=[5]", "robot.sigma_theta_deg: takes as many values"),
        ("arm.achieved=tf", "arm.achieved: tf takes arm.finger_joints or topics.gripper"),
        ("arm.achieved=odometry", "arm.achieved: 'odometry' is not one of topic, tf, columns"),
        ("arm.finger_sign=0", "arm.finger_sign: takes 1 or -1"),
        ("meshes.source=shapenet", "meshes.source: 'shapenet' is not one of procedural, open_objects, rgb_objects"),
        ("meshes.size_max_cm=1", "meshes.size_max_cm: "),
        ("networks=[vgg]", "networks: 'vgg'"),
        ("networks=[alexnet", "networks=[alexnet: "),
        ("topics.depth=${nowhere}", "topics.depth: "),
        ("topics.depth=???", "topics.depth: missing"),
        ("topics.depth", "topics.depth: takes GROUP=CHOICE or KEY=VALUE"),
        ("topics.depth=", "topics.depth: empty; it takes sensor_msgs/Image"),
        ("gripper.name=", "gripper.name: empty"),
        ("compute.address=", "compute.address: empty; it takes running Dask scheduler"),
        ("meshes.folder=", "meshes.folder: empty; it takes directory or .zip"),
        ("meshes.folder=${oc.env:HOME}", "meshes.folder: '${oc.env:HOME}' holds ${"),
        ("meshes.folder=\udcff", "meshes.folder: '\\udcff' is not UTF-8"),
        ("meshes.folder=~nobody-here/x", "meshes.folder: '~nobody-here/x' is not expanded"),
        ("robot.folder=s3://x/y", "robot.folder: 's3://x/y' is a URL"),
        ("label=5", "label: takes a mapping"),
        ("gripper=claw", "gripper: 'claw' is not one of franka_hand, kinova_mico"),
        ("gripper.joints=sliding", "gripper.joints: 'sliding' is not one of revolute, prismatic"),
        ("gripper.joints=prismatic", "gripper.knuckle_mm: unknown key; gripper takes name, joints, opening_mm"),
        ("gripper.gear_friction_nm=100", "gripper.gear_friction_nm: takes less than gripper.torque_nm"),
        ("attempt.close_s=0.01", "attempt.close_s: takes at least"),
    ],
)
def test_bad_argument_is_one_line_and_writes_nothing(workplace, argument, names):
    result = CliRunner().invoke(app, ["params", argument])
    assert result.exit_code == 2
    assert result.stderr.startswith(names)
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    assert not (workplace / "params.yaml").exists()


@pytest.mark.parametrize("key", ["meshes.folder", "robot.folder"])
def test_a_folder_that_dvc_would_remove_is_refused_before_anything_is_written(workplace, key):
    (workplace / "dvc.yaml").symlink_to(ROOT / "dvc.yaml")
    before = "as it was"
    (workplace / "params.yaml").write_text(before)
    result = CliRunner().invoke(app, ["params", f"{key}=data/recordings"])
    assert result.exit_code == 2
    assert result.stderr.startswith(
        f"{key}: 'data/recordings' shares files with data/recordings, which stage record_robot"
    )
    assert result.stderr.count("\n") == 1
    assert (workplace / "params.yaml").read_text() == before


def test_a_file_that_cannot_be_written_is_one_line(workplace):
    (workplace / "params.yaml").mkdir()
    result = CliRunner().invoke(app, ["params"])
    assert result.exit_code == 2
    assert result.stderr == "params.yaml: cannot be written: Is a directory\n"
    assert CliRunner().invoke(app, ["check"]).stderr.startswith("params.yaml: cannot be read: Is a directory\n")


def test_params_away_from_conf_says_where_it_looked(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["params"])
    assert result.exit_code == 2
    assert result.stderr.startswith("conf/config.yaml: no such file")


@pytest.mark.parametrize("choice", sorted(path.stem for path in CONF.glob("gripper/*.yaml")))
def test_a_gripper_needs_every_key_of_its_joints(choice):
    gripper = composed(f"gripper={choice}")["gripper"]
    for key in gripper:
        values = composed(f"gripper={choice}")
        del values["gripper"][key]
        with pytest.raises(ParameterError, match=f"^gripper.{key}: missing$"):
            validate(values)


def test_every_key_has_its_meaning_as_a_comment():
    lines = (ROOT / "params.yaml").read_text().splitlines()
    assert max(map(len, lines)) <= 120

    def meanings(cls):
        for hint in typing.get_type_hints(cls, include_extras=True).values():
            if typing.get_origin(hint) is typing.Annotated:
                yield typing.get_args(hint)[1].meaning
            else:
                yield from meanings(hint if dataclasses.is_dataclass(hint) else typing.get_args(hint)[1])

    comments = [line.partition("  # ")[2] for line in lines if "  # " in line]
    assert len(comments) == len(flat(composed()))
    for meaning in meanings(Params):
        assert any(comment.startswith(meaning) for comment in comments), meaning
