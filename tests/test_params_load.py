"""What params.yaml may hold, and which of it a stage is given."""

import copy
import dataclasses
import math
import typing
from functools import reduce
from pathlib import Path

import pytest
import yaml

from graspfn.params import Compute, Network, ParameterError, Params, load, section_type, validate

ROOT = Path(__file__).parents[1]
VALUES = yaml.safe_load((ROOT / "params.yaml").read_text())


def walk(cls=Params, values=VALUES, path=()):
    """(path, type, rule) of every key of params.yaml."""
    for name, hint in typing.get_type_hints(cls, include_extras=True).items():
        if typing.get_origin(hint) is typing.Annotated:
            yield (*path, name), *typing.get_args(hint)[:2]
        elif dataclasses.is_dataclass(hint):
            yield from walk(section_type(hint, values[name]), values[name], (*path, name))
        else:
            for entry in values[name]:
                inner = values[name][entry]
                yield from walk(section_type(typing.get_args(hint)[1], inner), inner, (*path, name, entry))


KEYS = [pytest.param(*key, id=".".join(key[0])) for key in walk()]
BOUNDED = [pytest.param(*k, id=".".join(k[0])) for k in walk() if {k[2].at_least, k[2].above, k[2].at_most} != {None}]
SECTIONS = [pytest.param(path, id=".".join(path) or "params.yaml") for path in sorted({key[0][:-1] for key in walk()})]


def changed(path, value):
    """VALUES with one key set, or removed where value is `del`."""
    values = copy.deepcopy(VALUES)
    section = values
    for name in path[:-1]:
        section = section[name]
    if value == "del":
        del section[path[-1]]
    else:
        section[path[-1]] = value
    return values


def refused(values):
    with pytest.raises(ParameterError) as caught:
        validate(values)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_params_yaml_is_valid():
    assert isinstance(validate(VALUES), Params)


@pytest.mark.parametrize("path, hint, rule", KEYS)
def test_wrong_type_names_the_key(path, hint, rule):
    assert refused(changed(path, {"a": 1})).startswith(".".join(path) + ": takes")
    if hint not in (str, str | None):
        assert refused(changed(path, "many")).startswith(".".join(path) + ": takes")


@pytest.mark.parametrize("path, hint, rule", KEYS)
def test_missing_key_is_named(path, hint, rule):
    assert refused(changed(path, "del")) == ".".join(path) + ": missing"


@pytest.mark.parametrize("path", SECTIONS)
def test_unknown_key_is_named(path):
    assert refused(changed((*path, "colour"), 1)).startswith(".".join((*path, "colour")) + ": unknown key")


@pytest.mark.parametrize("path, hint, rule", BOUNDED)
def test_bounds_hold_at_their_edge(path, hint, rule):
    many = typing.get_origin(hint) is tuple
    step = 1 if hint is int else 1e-9

    def wrapped(value):
        return [value] * len(reduce(lambda inner, name: inner[name], path, VALUES)) if many else value

    outside = [rule.at_least - step] if rule.at_least is not None else []
    outside += [rule.above] if rule.above is not None else []
    outside += [rule.at_most + step] if rule.at_most is not None else []
    for value in outside:
        assert refused(changed(path, wrapped(value))).startswith(".".join(path) + ": ")
    # The edge itself is allowed; keys that must agree with another one may then refuse, but not this rule.
    for value in (rule.at_least, rule.at_most):
        if value is not None:
            rule.check(int(value) if hint is int else float(value), "key")


@pytest.mark.parametrize("number", [math.nan, True, "5", None, [5]])
def test_a_number_is_a_number(number):
    assert refused(changed(("camera", "fx_px"), number)).startswith("camera.fx_px: takes float")


def test_whole_numbers_are_floats_where_floats_are_taken():
    density = validate(changed(("physics", "density_kgm3"), 600)).physics.density_kgm3
    assert (density, type(density)) == (600.0, float)


@pytest.fixture
def root(tmp_path):
    """A folder with params.yaml and a small dvc.yaml."""
    (tmp_path / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    stages = {
        "settle": {"params": ["seed", "physics"]},
        "train": {"params": ["train", "network.${item.network}"]},
        "nosy": {"params": ["camera.fx_px"]},
        "idle": {"cmd": "true"},
    }
    (tmp_path / "dvc.yaml").write_text(yaml.safe_dump({"stages": stages}))
    return tmp_path


def test_stage_gets_what_it_declares(root):
    params = load("settle", root=root)
    whole = validate(VALUES)
    assert (params.seed, params.physics) == (whole.seed, whole.physics)


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(Params)])
def test_stage_gets_nothing_else(root, name):
    params = load("settle", root=root)
    if name in ("seed", "physics", "compute"):
        assert getattr(params, name) == getattr(validate(VALUES), name)
    else:
        with pytest.raises(ParameterError, match=f"^{name}: stage settle does not declare"):
            getattr(params, name)


def test_compute_comes_along_undeclared(root):
    assert isinstance(load("idle", root=root).compute, Compute)


def test_network_of_the_item_and_no_other(root):
    params = load("train", "fcn", "0", root=root)
    assert isinstance(params.network, Network)
    assert params.network == validate(VALUES).network["fcn"]
    with pytest.raises(ParameterError, match=r"^network\.vgg: missing"):
        load("train", "vgg", "0", root=root)


def test_parts_of_sections_are_not_declared(root):
    with pytest.raises(ParameterError, match=r"^camera\.fx_px: stage nosy may declare whole sections"):
        load("nosy", root=root)


def test_undeclared_sections_are_validated_too(root):
    (root / "params.yaml").write_text(yaml.safe_dump(changed(("noise", "sigma_p_px"), -1)))
    with pytest.raises(ParameterError, match=r"^noise\.sigma_p_px"):
        load("settle", root=root)


@pytest.fixture
def project(tmp_path):
    """The repository's params.yaml and dvc.yaml, with outputs of every kind and every way to name one."""
    folder = tmp_path / "project"
    folder.mkdir()
    (folder / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    stages = yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"]
    stages["kinds"] = {"metrics": ["kinds/metric.json"], "plots": [{"kinds/plot.csv": {"x": "step"}}]}
    stages["named"] = {"outs": ["by-${scale}/${meshes.source}", "by-${ robot.objects }/${item}.csv"]}
    stages["foreach"] = {"foreach": [1, 2], "do": {"wdir": "inner", "outs": ["each/${item}"]}}
    (folder / "dvc.yaml").write_text(yaml.safe_dump({"stages": stages}, sort_keys=False))
    return folder


def with_folder(project, key, folder):
    section, name = key.split(".")
    (project / "params.yaml").write_text(yaml.safe_dump(changed((section, name), str(folder))))
    return load("select_meshes", root=project)


@pytest.mark.parametrize("key", ["meshes.folder", "robot.folder"])
@pytest.mark.parametrize(
    "folder, out",
    [
        ("data/recordings", "data/recordings"),
        ("data/recordings/", "data/recordings"),
        ("data/recordings/of/mine", "data/recordings"),
        ("./data/../data/recordings", "data/recordings"),
        ("../project/data/recordings", "data/recordings"),
        ("data/objects/train", "data/objects/train"),
        ("data", "data/inputs_checked"),
        (".", "data/inputs_checked"),
        ("..", "data/inputs_checked"),
        ("/", "data/inputs_checked"),
        ("data/networks/fcn", "data/networks"),
        ("data/networks/mine", "data/networks"),
        ("data/functions", "data/functions"),
        ("reports", "reports/desktop/table1.csv"),
        ("reports/desktop/figures/mine", "reports/desktop/figures"),
        ("kinds", "kinds/metric.json"),
        ("kinds/plot.csv", "kinds/plot.csv"),
        ("by-desktop/procedural/x", "by-desktop/procedural"),
        ("by-20/x", "by-20"),
        ("inner/each/3", "inner/each"),
    ],
)
def test_a_folder_that_shares_files_with_an_output_is_refused(project, key, folder, out):
    for written in (folder, project / folder):
        with pytest.raises(ParameterError) as caught:
            with_folder(project, key, written)
        message = str(caught.value)
        assert message.startswith(f"{key}: {str(written)!r} shares files with {out}, which stage ")
        assert "\n" not in message


@pytest.mark.parametrize("key", ["meshes.folder", "robot.folder"])
def test_links_to_and_from_outputs_are_followed(project, tmp_path, key):
    out = project / "data/recordings"
    (out / "inside").mkdir(parents=True)
    (tmp_path / "link").symlink_to(out)
    (tmp_path / "parent").symlink_to(project / "data")
    (tmp_path / "inside").symlink_to(out / "inside")
    (tmp_path / "elsewhere").mkdir()
    (out / "away").symlink_to(tmp_path / "elsewhere")  # the link itself would be removed
    (project / "data/objects").mkdir()
    (project / "data/objects/train").symlink_to(tmp_path / "elsewhere")
    links = [tmp_path / name for name in ("link", "parent", "parent/recordings", "parent/recordings/x", "inside")]
    for folder in (*links, "../link", "data/recordings/away", tmp_path / "elsewhere", "../elsewhere/mine"):
        with pytest.raises(ParameterError, match=f"^{key}: .* shares files with data/"):
            with_folder(project, key, folder)


@pytest.mark.parametrize("key", ["meshes.folder", "robot.folder"])
@pytest.mark.parametrize(
    "folder", ["inputs/recordings", "../recordings", "data2", "recordings", "data/recordings2", "datä", "by-paper"]
)
def test_a_folder_apart_from_outputs_is_taken(project, key, folder):
    with_folder(project, key, folder)
    with_folder(project, key, project / folder)


@pytest.mark.parametrize("path", [path for path, hint, rule in walk() if hint in (str, str | None)], ids=".".join)
@pytest.mark.parametrize("text", ["", "a${b}"])
def test_text_is_not_empty_and_no_template(path, text):
    assert refused(changed(path, text)).startswith(".".join(path) + ": ")


def test_a_folder_that_dvc_would_not_expand_is_refused():
    for key in ("meshes.folder", "robot.folder"):
        assert refused(changed(tuple(key.split(".")), "~/x")).startswith(f"{key}: '~/x' is not expanded")


def test_file_that_is_absent_or_not_yaml_is_named(root):
    (root / "params.yaml").write_text("seed: 0\nmeshes: [1, 2\ncamera: {")
    with pytest.raises(ParameterError, match=r"params\.yaml: not YAML: .*line 3"):
        load("settle", root=root)
    (root / "params.yaml").write_bytes("scale: Größe".encode("latin-1"))
    with pytest.raises(ParameterError, match=r"params\.yaml: not UTF-8"):
        load("settle", root=root)
    (root / "params.yaml").unlink()
    with pytest.raises(ParameterError, match=r"params\.yaml: no such file$"):
        load("settle", root=root)


@pytest.mark.parametrize("scale", ["..", ".", "a/b", "mine ", "a\\b"])
def test_a_scale_names_a_folder_of_reports(scale):
    with pytest.raises(ParameterError, match=r"^scale: .* names a folder of reports; it takes letters, digits"):
        validate(changed(("scale",), scale))
