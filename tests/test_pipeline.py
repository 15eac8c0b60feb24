"""The whole workflow at scale=smoke: it runs, reruns what a change affects, survives SIGKILL, travels by remote.

The tests of this file share one run, and leave it as they found it.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from dvc.repo import Repo
from networkx import ancestors

from graspfn.physics.labelling import ENDS, OUTCOMES, RETRIED, successes

ROOT = Path(__file__).parents[1]
# DVC asks pygtrie for what it will one day no longer give.
pytestmark = pytest.mark.filterwarnings("ignore:_NoneStep:DeprecationWarning")

FIGURES = ("training_example", "predictions", "success_vs_sigma_uv", "growing_uncertainty", "noise", "inpainting")


def changed_stages(repo: Repo) -> set[str]:
    """Names of the stages whose parameters, code or files differ from dvc.lock."""
    return {address.rpartition(":")[2] for address in repo.status()}


TELL_OF_THE_RUN = {"index.html", "provenance.json"}  # how long it took, and where


class Workspace:
    """A checkout of the project in a folder of its own."""

    def __init__(self, folder: Path):
        self.folder = folder
        # The checkout's own code, not the installed one.
        self.env = os.environ | {"PYTHONPATH": str(folder / "src"), "PYTHONDONTWRITEBYTECODE": "1", "CI": "true"}

    def run(self, *command: str, check: bool = True) -> subprocess.CompletedProcess[str]:
        done = subprocess.run(command, cwd=self.folder, env=self.env, capture_output=True, text=True, timeout=1200)
        assert not check or done.returncode == 0, f"{' '.join(command)}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
        return done

    def git(self, *command: str) -> None:
        self.run("git", "-c", "user.name=t", "-c", "user.email=t@example.org", "-c", "commit.gpgsign=false", *command)

    def lock(self) -> dict[str, Any]:
        """Hash of every output, but of those that say how long the stages took."""
        lock = yaml.safe_load((self.folder / "dvc.lock").read_text())
        outs = [out for stage in lock["stages"].values() for out in stage.get("outs", [])]
        return {out["path"]: out["md5"] for out in outs if Path(out["path"]).name not in TELL_OF_THE_RUN}

    def would_run(self) -> set[str]:
        """The stages that `dvc status` finds changed, and all that come after them."""
        with Repo(str(self.folder)) as repo:
            stages = {stage.name: stage for stage in repo.index.stages}
            changed = changed_stages(repo)
            after = {later.name for name in changed for later in ancestors(repo.index.graph, stages[name])}
        return {name.partition("@")[0] for name in changed | after}

    def repro_runs(self) -> list[str]:
        lines = self.run("dvc", "repro").stdout.splitlines()
        return [line for line in lines if line.startswith("Running stage")]


def copy_of_the_project(folder: Path) -> Workspace:
    # What git ignores, without asking git: the checkout may be an unpacked archive, or another user's.
    files = (ROOT / ".gitignore", ROOT / ".dvc/.gitignore")
    ignored = [line.strip("/") for file in files for line in file.read_text().splitlines()]
    leave_out = shutil.ignore_patterns(*ignored, ".git", "shared", "reports", "dvc.lock")
    shutil.copytree(ROOT, folder, ignore=leave_out, dirs_exist_ok=True)
    workspace = Workspace(folder)
    workspace.git("init", "-q", "-b", "main")
    return workspace


@pytest.fixture(scope="session")
def smoke(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """One finished run at scale=smoke, committed."""
    workspace = copy_of_the_project(tmp_path_factory.mktemp("smoke"))
    workspace.run("graspfn", "params", "scale=smoke")
    workspace.run("dvc", "repro")
    workspace.git("add", "-A")
    workspace.git("commit", "-qm", "A run at scale=smoke")
    return workspace


@pytest.fixture
def edited(smoke: Workspace) -> Iterator[Callable[[str, Any], None]]:
    """Changes a key of the run's params.yaml for one test."""
    path = smoke.folder / "params.yaml"
    before = path.read_text()

    def edit(key: str, value: Any) -> None:
        values = yaml.safe_load(path.read_text())
        *sections, last = key.split(".")
        inner = values
        for section in sections:
            inner = inner[section]
        inner[last] = value
        path.write_text(yaml.safe_dump(values))

    yield edit
    path.write_text(before)


def test_both_tables_are_filled(smoke: Workspace) -> None:
    table1 = pd.read_csv(smoke.folder / "reports/smoke/table1.csv")
    everything = table1[table1["objects_of"] == "all"]
    assert len(everything) == 16 * (1 + 2 * 3 + 2)  # Centroid, two networks, the true function
    assert table1["success"].between(0, 1).all()
    assert (table1["ci_low"] <= table1["success"]).all()
    assert (table1["success"] <= table1["ci_high"]).all()
    table2 = pd.read_csv(smoke.folder / "reports/smoke/table2.csv")
    assert len(table2) == 2 * 5
    robustness = pd.read_csv(smoke.folder / "reports/smoke/robustness.csv")
    assert (
        len(robustness) == 34 * (2 * 3 + 2) + 2
    )  # shots: with and without the fit, on depth without; the true function once
    assert table2["simulated"].all()


def test_every_figure_is_drawn(smoke: Workspace) -> None:
    drawn = {path.name for path in (smoke.folder / "reports/smoke/figures").iterdir()}
    trials = pd.read_parquet(smoke.folder / "data/robot_trials.parquet")
    failed = trials[~trials["success"]]
    pages = {f"{path.name.removesuffix('.png')}" for path in (smoke.folder / "data/robot_failures").iterdir()}
    assert pages == set(failed["file"])
    assert len({name for name in drawn if name.startswith("failed_trial_")}) == min(3, failed["object"].nunique())
    # What was planned again on the recorded images is what was recorded, and fingers and lift tell what became of it.
    assert (trials["replanned"] == "").all() and (trials["flags"] == "").all()
    held = trials["judged"].map({"held": True, "failed": False})
    assert (held == trials["success"])[trials["u_m"].notna()].all() and (failed["why"] != "").all()
    assert {f"{name}.{kind}" for name in FIGURES for kind in ("png", "pdf")} <= drawn
    page = (smoke.folder / "reports/smoke/index.html").read_text()
    assert page.count("data:image/png;base64") == sum(name.endswith(".png") for name in drawn)


@pytest.mark.parametrize("networks", [["alexnet", "fcn"], ["fcn"]])
def test_plots_show_the_networks_that_there_are(
    smoke: Workspace, edited: Callable[[str, Any], None], networks: list[str]
) -> None:
    edited("networks", networks)
    done = smoke.run("dvc", "plots", "show", "--json")
    assert "failed" not in done.stderr
    shown = json.loads(done.stdout)
    assert not shown.get("errors")
    drawn = {name for name, plots in shown["data"].items() if plots}
    losses = {f"data/networks/{network}-0/history.csv" for network in networks}
    assert drawn == losses | {"Success against position uncertainty (Table 1)"}


@pytest.mark.parametrize("split", ["train", "test"])
def test_every_attempt_is_accounted_for(smoke: Workspace, split: str) -> None:
    account = pd.read_parquet(smoke.folder / f"data/labels/{split}.parquet")
    assert set(account) == {"id", "status", "best", *OUTCOMES, *ENDS, RETRIED} and len(account) == 2
    assert (account[list(OUTCOMES)].sum(axis=1) == 43560).all()
    simulated = account[["held", "left", "missed", "diverged"]].sum(axis=1)
    assert account[list(ENDS)].sum(axis=1).tolist() == simulated.tolist()
    with np.load(smoke.folder / f"data/labels/{split}.npz") as labels:
        assert labels["successes"].reshape(len(account), -1).sum(axis=1).tolist() == account["held"].tolist()
        assert np.array_equal(labels["successes"], successes(labels["outcomes"]))
        counts = np.stack([np.bincount(one.ravel(), minlength=len(OUTCOMES)) for one in labels["outcomes"]])
    assert np.array_equal(counts, account[list(OUTCOMES)])
    assert (smoke.folder / f"data/labels/{split}.npz").stat().st_size < 20_000 * len(account)


def test_a_second_repro_runs_nothing(smoke: Workspace) -> None:
    assert smoke.repro_runs() == []


AFTER_LABELS = {"train", "predict", "evaluate", "disturb", "record_robot", "analyse_robot", "report"}


@pytest.mark.parametrize(
    ("key", "value", "stages"),
    [
        ("evaluate.sigma_uv_mm", [5.0, 10.0], {"evaluate", "report"}),
        ("train.epochs", 2, AFTER_LABELS),
        ("compute.workers", 1, set()),
        ("topics.outcome", "/held", {"record_robot", "analyse_robot", "report"}),
        ("disturb.objects", 2, {"disturb", "report"}),
        ("plan.fine_uv", 2, {"evaluate", "disturb", "record_robot", "analyse_robot", "report"}),
    ],
)
def test_a_parameter_reruns_what_it_affects(
    smoke: Workspace, edited: Callable[[str, Any], None], key: str, value: Any, stages: set[str]
) -> None:
    edited(key, value)
    assert smoke.would_run() == stages


def test_the_torque_reruns_grasping_alone(smoke: Workspace, edited: Callable[[str, Any], None]) -> None:
    edited("gripper.torque_nm", 1.2)
    with Repo(str(smoke.folder)) as repo:
        direct = {name.partition("@")[0] for name in changed_stages(repo)}
    # Placing asks the gripper how large an object may be: it runs, and finds the same.
    after = {"evaluate", "disturb", "record_robot", "analyse_robot", "report"}
    assert direct == {"place_objects", "label_grasps", *after}


@pytest.mark.parametrize(
    ("room", "stages"),
    [("reporting", {"analyse_robot", "report"}), ("robot", {"record_robot", "analyse_robot", "report"})],
)
def test_code_reruns_what_loads_it(smoke: Workspace, room: str, stages: set[str]) -> None:
    path = next((smoke.folder / "src/graspfn" / room).glob("*.py"))
    before = path.read_text()
    path.write_text(before + "\n# changed\n")
    try:
        assert smoke.would_run() == stages
    finally:
        path.write_text(before)


@pytest.mark.parametrize(
    ("key", "value", "named"),
    [
        ("train.epochz", 3, "train.epochz"),
        ("noise.sigma_d_mm", -1.5, "noise.sigma_d_mm"),
        ("colour", "red", "colour"),
        ("evaluate.sigma_uv_mm", [5, -5], "evaluate.sigma_uv_mm"),
    ],
)
def test_a_bad_parameter_is_one_line(
    smoke: Workspace, edited: Callable[[str, Any], None], key: str, value: Any, named: str
) -> None:
    edited(key, value)
    for command in (("graspfn", "check"), ("python", "stages/select_meshes.py")):
        done = smoke.run(*command, check=False)
        assert done.returncode != 0
        lines = (done.stdout + done.stderr).strip().splitlines()
        assert len(lines) == 1, lines
        assert named in lines[0]


def test_a_bad_mesh_folder_is_one_line(smoke: Workspace, edited: Callable[[str, Any], None], tmp_path: Path) -> None:
    edited("meshes.source", "folder")
    edited("meshes.folder", str(tmp_path / "nowhere"))
    done = smoke.run("python", "stages/select_meshes.py", check=False)
    assert done.returncode != 0
    assert done.stderr.strip().count("\n") == 0
    assert "nowhere" in done.stderr
    (tmp_path / "nowhere").mkdir()
    for k in range(6):  # as many as the run asks for, and one more
        (tmp_path / f"nowhere/empty_{k}.off").touch()
    done = smoke.run("python", "stages/select_meshes.py", check=False)
    assert done.returncode != 0
    *_, last = done.stderr.strip().splitlines()  # after the progress bar
    assert "6 rejected" in last and "empty file" in last and "Traceback" not in done.stderr
    smoke.run("dvc", "checkout")


def test_a_remote_carries_the_run(smoke: Workspace, tmp_path: Path) -> None:
    remote, elsewhere = tmp_path / "remote", tmp_path / "elsewhere"
    smoke.run("dvc", "remote", "add", "--force", "--local", "--default", "share", str(remote))
    smoke.run("dvc", "push", "--run-cache")
    smoke.git("clone", "-q", str(smoke.folder), str(elsewhere))
    clone = Workspace(elsewhere)
    clone.run("dvc", "remote", "add", "--local", "--default", "share", str(remote))
    ran = clone.run("dvc", "repro", "--pull").stdout
    made = {line.split("'")[1] for line in ran.splitlines() if line.startswith("Running stage")}
    cheap = {"select_meshes", "render_images", "augment", "record_robot", "analyse_robot"}  # hence not pushed
    assert made == cheap
    assert clone.repro_runs() == []
    assert clone.lock() == smoke.lock()


def test_recordings_of_a_folder_are_analysed_where_they_lie(
    smoke: Workspace, edited: Callable[[str, Any], None], tmp_path: Path
) -> None:
    own, data = tmp_path / "own", smoke.folder / "data"
    shutil.copytree(data / "recordings", own)
    bad = next(own.iterdir())
    bad.write_bytes(b"no recording")
    files = {path.name: path.read_bytes() for path in own.iterdir()}
    edited("robot.source", "folder")
    edited("robot.folder", str(own))
    edited("robot.max_failed", 1.0)
    try:
        done = smoke.run("python", "stages/analyse_robot.py")
        assert f"left out: {bad}: not an MCAP file" in done.stdout
        assert set(pd.read_parquet(data / "robot_trials.parquet")["file"]) == set(files) - {bad.name}
        assert pd.read_parquet(data / "robot_unused.parquet")["file"].tolist() == [bad.name]
        edited("robot.max_failed", 0.0)
        done = smoke.run("python", "stages/analyse_robot.py", check=False)
        assert done.returncode != 0
        assert done.stderr.strip().count("\n") == 0
        assert f"1 of {len(files)} bags cannot be used, more than robot.max_failed" in done.stderr
        assert {path.name: path.read_bytes() for path in own.iterdir()} == files
    finally:
        outs = ("trials.parquet", "uncertainty.parquet", "unused.parquet", "covariance", "failures")
        smoke.run("dvc", "checkout", "--force", *(f"data/robot_{name}" for name in outs))


@pytest.mark.parametrize("stage", ["label_grasps@train", "evaluate"])
def test_sigkill_in_the_middle_loses_nothing(smoke: Workspace, stage: str) -> None:
    before = smoke.lock()
    shards = smoke.folder / ".scratch" / stage
    kept = {path.name: path.read_bytes() for path in shards.iterdir()}
    for path in shards.iterdir():
        path.unlink()
    command = ["dvc", "repro", "--force", "--single-item", "--no-run-cache", stage]
    process = subprocess.Popen(
        command, cwd=smoke.folder, env=smoke.env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip
    deadline = time.monotonic() + 600
    while not list(shards.glob("*.npz")):
        assert process.poll() is None, "the stage ended before a shard landed"
        assert time.monotonic() < deadline
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    landed = {path.name for path in shards.glob("*.npz")}
    assert landed < set(kept), "the kill came too late to prove anything"
    done = smoke.run(*command)
    assert f"{len(landed)} of {len(kept)} objects were done before" in done.stdout
    smoke.run("dvc", "repro")
    assert {path.name: path.read_bytes() for path in shards.glob("*.npz")} == kept
    assert smoke.lock() == before
