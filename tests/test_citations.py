"""Citations of the paper name sections, equations and figures that it has, and the right ones where one can tell."""

from __future__ import annotations

import ast
import re
import subprocess
from pathlib import Path

import pytest
import yaml

from graspfn.reporting.paper import SECTIONS

ROOT = Path(__file__).parents[1]
EQUATIONS = {1: "III", 2: "IV-B", 3: "V", 4: "V"}
FIGURES = {1: "I", 2: "III", 3: "IV-A", 4: "IV-C", 5: "V", 6: "VI", 7: "VII-A", 8: "VII-B", 9: "VII-B"}
FIGURES |= {10: "VII-B", 11: "VII-B"}

# What each room and stage may cite.
ROOMS = {
    "geometry": {"III"},
    "meshes": {"IV-A", "IV-C"},
    "formats": set(),
    "selection": {"IV-C", "VII"},
    "physics": {"IV-A", "IV-C"},
    "imaging": {"IV-B", "V", "VI"},
    "learning": {"V", "VII"},
    "planning": {"VI", "VII-A"},
    "evaluation": {"VII-A"},
    "robot": {"VII-B"},
    "workflow": set(),
    "commands": {"VI", "VII-A", "VII-B"},
    "reporting": set(SECTIONS),
}
STAGES = {
    "check_inputs": set(),
    "select_meshes": {"IV-C", "VII"},
    "place_objects": {"IV-C"},
    "label_grasps": {"IV-C"},
    "render_images": {"IV-B", "VII-A"},
    "augment": {"VII"},
    "pretrain": {"VII"},
    "train": {"V"},
    "predict": {"V", "VII-A"},
    "evaluate": {"VII-A"},
    "disturb": set(),
    "record_robot": {"VII-B"},
    "analyse_robot": {"VII-B"},
    "report": set(),
}
FILES = {
    "src/graspfn/commands/label_mesh.py": {"IV-A", "IV-B", "IV-C"},
    "conf/gripper/kinova_mico.yaml": {"III", "IV-A"},
    "docs/physics.md": {"IV-A", "IV-C"},
    "docs/objects.md": {"IV-C", "VII"},
    "docs/recordings.md": {"VII-B"},
}
# Citations outside the file's own sections, each with its reason.
BESIDES = {
    ("src/graspfn/geometry/grid.py", "IV-C"): "attempts are drawn in the cells of Q",
    ("src/graspfn/imaging/placement.py", "VII"): "training images are shifted so that the object stays in view",
    ("src/graspfn/imaging/placement.py", "VII-A"): "test objects are placed so",
    ("src/graspfn/planning/target.py", "III"): "the chain of frames is printed there",
    ("src/graspfn/learning/depth_inputs.py", "IV-B"): "the noise of eq. 2 is drawn as samples are made",
    ("src/graspfn/learning/height_inputs.py", "IV-B"): "its jitter is drawn as samples are made",
    ("src/graspfn/learning/sensor.py", "IV-B"): "and so is its error of depth, with all else that cameras do",
    ("src/graspfn/planning/methods.py", "V"): "the network's likeliest class is a score to plan by",
    ("src/graspfn/evaluation/planner.py", "V"): "the network's likeliest class is a score to plan by",
    ("src/graspfn/evaluation/expected.py", "IV-C"): "it rests on the attempts of labels",
    ("src/graspfn/robot/depth_holes.py", "VI"): "the holes that hole filling is for",
    ("src/graspfn/commands/card.md.j2", "IV-B"): "the noise that a network was trained with",
    ("src/graspfn/robot/target.py", "III"): "a target in the image becomes a pose of the robot",
    ("src/graspfn/robot/simulated.py", "IV-B"): "the simulated robot's camera has the noise of eq. 2",
}
# Sections of the keys of params.yaml, which params.py has as the docstrings of their classes.
KEYS = {
    "meshes": {"IV-C", "VII"},
    "camera": {"III"},
    "noise": {"IV-B"},
    "gripper": {"IV-A"},
    "physics": {"IV-A"},
    "settle": {"IV-C"},
    "attempt": {"IV-A"},
    "label": {"IV-C"},
    "augment": {"VII"},
    "network": {"V"},
    "pretrain": {"VII"},
    "train": {"V"},
    "plan": {"VI"},
    "evaluate": {"VII-A"},
    "disturb": set(),
    "robot": {"VII-B"},
    "arm": {"VII-B"},
}
# The rows of docs/deviations.md.
TOPICS = {
    "III": {"camera"},
    "IV-A": {"gripper", "torque", "collision", "runaways", "early stops"},
    "IV-B": {"eq. 2"},
    "IV-C": {"objects", "rest", "size", "room", "labels", "success"},
    "V": {"loss", "score", "network", "input"},
    "VI": {"refinement", "smoothing", "hole filling"},
    "VII": {"augmentation", "pre-training"},
    "VII-A": {"split", "Centroid", "planning", "trials", "true function"},
    "VII-B": {"σuv", "robot", "Σ", "depth holes"},
}

NUMERAL = r"(?:X|IX|IV|V?I{0,3})(?:-[A-Z])?"
# Numerals of several letters are citations wherever they stand; V, where it stands as one does.
LONG = re.compile(rf"(?<![\w-])(?=[IVX]{{2}}|[IVX]-[A-Z]\b){NUMERAL}(?![\w-])")
SHORT = re.compile(r"(?:[Pp]aper,? |, |; | and | to |\(|^\| |\| )(V)(?=\)| \||, [^\d\s]|; | and | to |,? ')", re.M)
TABLES = re.compile(r"Tables? I+(?: and I+)?\b")
EQUATION, FIGURE = re.compile(r"\b[Ee]q\. (\d+)"), re.compile(r"\bFigs?\. (\d+)")


def cited(text: str) -> set[str]:
    """The sections that a text cites, by themselves or by equations and figures of theirs; "eq. 9" if there is none."""
    text = TABLES.sub("", text)
    found = {match.group(0) for match in LONG.finditer(text)} | {match.group(1) for match in SHORT.finditer(text)}
    for pattern, sections, name in ((EQUATION, EQUATIONS, "eq."), (FIGURE, FIGURES, "Fig.")):
        found |= {sections.get(int(n), f"{name} {n}") for n in pattern.findall(text)}
    return found


def tracked() -> list[str]:
    """The files that people write and read, but this one: it has examples of what may not be."""
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True)
    names = [name for name in listed.stdout.splitlines() if not name.startswith("reports/")]
    return [
        name
        for name in names
        if name.endswith((".py", ".md", ".yaml", ".j2", "Makefile"))
        and name != "tests/test_citations.py"
        and (ROOT / name).is_file()
    ]


def allowed(name: str) -> set[str]:
    """The sections that a file may cite: those of its room or stage, and what it cites besides."""
    parts = Path(name).parts
    if name in FILES:
        return FILES[name]
    if parts[0] == "src" and len(parts) > 3 and parts[2] != "models":
        own = ROOMS[parts[2]]
    elif parts[0] == "stages":
        own = STAGES[Path(name).stem]
    elif parts[0] == "tests" and (room := Path(name).stem.split("_")[1:2]) and room[0] in ROOMS:
        own = ROOMS[room[0]]
    elif parts[0] == "benchmarks":
        own = ROOMS["physics"]
    else:
        own = set(SECTIONS)
    return own | {section for file, section in BESIDES if file == name}


if not (ROOT / ".git").exists():
    pytest.skip("not a git checkout", allow_module_level=True)


@pytest.mark.parametrize(
    ("text", "sections"),
    [
        ("Grasp attempts (paper IV-C), five", {"IV-C"}),
        ("(paper V, VII): networks", {"V", "VII"}),
        ("as the paper scores (V), comes", {"V"}),
        ("by the paper V-A and VI", {"V-A", "VI"}),
        ("| V, loss | printed |", {"V"}),
        ("| `learning` | the networks | V, VII |", {"V", "VII"}),
        ("(paper IV-A to\n    IX)", {"IV-A", "IX"}),
        ("the paper's eq. 2 and Fig. 12", {"IV-B", "Fig. 12"}),
        ("Tables I and II; vertices at (V,) depths and (V, 2) pixels; dict[str, V]; Type-II", set()),
    ],
)
def test_citations_are_found(text: str, sections: set[str]) -> None:
    assert cited(text) == sections


def test_every_citation_names_a_section_of_the_paper() -> None:
    wrong = {name: cited((ROOT / name).read_text()) - set(SECTIONS) for name in tracked()}
    assert {name: sections for name, sections in wrong.items() if sections} == {}


def test_files_cite_the_sections_that_are_their_own() -> None:
    wrong = {name: cited((ROOT / name).read_text()) - allowed(name) for name in tracked()}
    assert {name: sections for name, sections in wrong.items() if sections} == {}


def test_exceptions_are_needed() -> None:
    for name, section in BESIDES:
        assert section in cited((ROOT / name).read_text()), (name, section)


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_cites_what_its_script_does(stage: str) -> None:
    desc = yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"][stage]["desc"]
    docstring = ast.get_docstring(ast.parse((ROOT / f"stages/{stage}.py").read_text())) or ""
    assert cited(desc) == cited(docstring) == STAGES[stage]


def test_keys_of_the_parameters_cite_their_sections() -> None:
    comment = ""
    for line in (ROOT / "params.yaml").read_text().splitlines():
        key = line.partition(":")[0]
        if key in KEYS:
            assert cited(comment) <= KEYS[key], key
        comment = line if line.startswith("#") else ""


def test_rooms_of_the_architecture_are_beside_their_sections() -> None:
    rows = (ROOT / "docs/architecture.md").read_text().splitlines()
    table = {row.split("|")[1].strip(" `"): row.split("|")[3] for row in rows if row.count("|") == 4}
    for room, sections in ROOMS.items():
        if sections and room != "reporting":
            assert cited(f"| {table[room].strip()} |") == sections, room


def test_deviations_stand_under_their_sections() -> None:
    rows = (ROOT / "docs/deviations.md").read_text().split("|---|---|---|---|\n")[1].splitlines()
    found = [row.split("|")[1].strip().partition(", ") for row in rows]
    for section, _, topic in found:
        assert topic in TOPICS[section], f"{section}, {topic}"
    order = list(SECTIONS)
    assert [section for section, _, _ in found] == sorted((section for section, _, _ in found), key=order.index)
