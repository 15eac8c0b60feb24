"""`graspfn params`: conf/ composes to params.yaml, and bad arguments are one line that names the key."""

import dataclasses
import typing
from pathlib import Path

import pytest
import yaml
from hydra.core.global_hydra import GlobalHydra
from typer.testing import CliRunner

from graspfn.cli import app
from graspfn.compose import compose, render
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
    result = CliRunner().invoke(app, ["params", "scale=smoke", "camera.focal_px=600.5", "topics.depth=/my depth"])
    assert (result.exit_code, result.output) == (0, "")
    written = yaml.safe_load((workplace / "params.yaml").read_text())
    assert written == composed("scale=smoke", "camera.focal_px=600.5", "topics.depth=/my depth")
    assert [path.name for path in workplace.iterdir() if path.name != "conf"] == ["params.yaml"]


@pytest.mark.parametrize("choice", CHOICES)
def test_every_choice_of_every_group_is_valid(choice):
    overrides = [choice, *([NEEDS[choice]] if choice in NEEDS else [])]
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
    assert {key for key in desktop if desktop[key] != other[key]} <= COUNTS | {"scale"}
    assert set(flat(yaml.safe_load((CONF / f"scale/{scale}.yaml").read_text()))) == COUNTS | {"scale"}
    assert other["scale"] == scale


def test_paper_scale_has_the_papers_counts():
    paper = flat(composed("scale=paper"))
    assert [paper[key] for key in ("meshes.train", "meshes.test", "augment.samples")] == [1000, 1000, 1000]
    assert (paper["robot.objects"], paper["robot.placements"]) == (20, 5)


@pytest.mark.parametrize("choice, names", [("network=fcn", ["fcn"]), ("network=[fcn, alexnet]", ["fcn", "alexnet"])])
def test_networks_follow_the_chosen_ones(choice, names):
    values = composed(choice)
    assert values["networks"] == names
    assert set(values["network"]) == set(names)


def test_network_files_are_named_after_their_architecture():
    assert all(name == entry["architecture"] for name, entry in composed()["network"].items())


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
        ("camera.focal=570", "camera.focal: unknown key; camera takes width_px, height_px, focal_px, renderer"),
        ("camera.focal_px.x=570", "camera.focal_px: takes float"),
        ("camera.focal_px=wide", "camera.focal_px: takes float, not 'wide'"),
        ("camera.focal_px=nan", "camera.focal_px: takes float"),
        ("meshes.train=1.5", "meshes.train: takes int, not 1.5"),
        ("meshes.train=true", "meshes.train: takes int, not True"),
        ("noise.sigma_p_px=-1", "noise.sigma_p_px: "),
        ("evaluate.sigma_uv_mm=[5,-10]", "evaluate.sigma_uv_mm: "),
        ("evaluate.sigma_uv_mm=5", "evaluate.sigma_uv_mm: takes a list"),
        ("robot.sigma_uv_mm=[5]", "robot.sigma_theta_deg: takes as many values"),
        ("meshes.source=shapenet", "meshes.source: 'shapenet' is not one of procedural, open_objects, rgb_objects"),
        ("meshes.size_max_cm=1", "meshes.size_max_cm: "),
        ("networks=[vgg]", "networks: 'vgg'"),
        ("networks=[alexnet", "networks=[alexnet: "),
        ("topics.depth=${nowhere}", "topics.depth: "),
        ("topics.depth=???", "topics.depth: missing"),
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
