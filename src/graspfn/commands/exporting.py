"""What `graspfn model export` does: a trained network and what dvc.lock says of its training, in one folder.

dvc.lock and not params.yaml, which may have been edited since.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import shutil
from pathlib import Path
from typing import Any

from graspfn.commands.card import card
from graspfn.commands.ending import InputError
from graspfn.evaluation.planner import TRUE
from graspfn.learning.folder import read_config, read_network
from graspfn.learning.onnx_file import write_onnx
from graspfn.learning.weights import load_network
from graspfn.params import ParameterError, read_yaml
from graspfn.planning.model import FEWEST_PX, FORMAT, GRID, NETWORK
from graspfn.planning.planner import GraspPlanner
from graspfn.reporting.metrics import slug
from graspfn.workflow.files import atomic

WEIGHTS, CONFIG, CARD = "weights.safetensors", "config.json", "README.md"  # beside network.onnx
NETWORKS, FUNCTIONS, TRIALS = Path("data/networks"), Path("data/functions"), "data/trials.parquet"
LOCK = Path("dvc.lock")
LICENCE, OURS = "MIT", "procedural"  # the code's own, and the meshes that it makes
PACKAGES = ("graspfn", "torch", "numpy", "dartpy")


def export_model(out: Path, run: str | None, licence: str | None) -> str:
    """Writes the folder `out`; returns what there is to say of it. InputError names the file that is missing."""
    try:
        lock = read_yaml(LOCK)["stages"]
        run = run or _default_run(lock)
        folder = NETWORKS / run
        ran = _ran(lock, run)
        if _md5(folder / WEIGHTS) != ran["md5"]:
            raise InputError(f"{folder / WEIGHTS}: not what train@{run} wrote, says {LOCK}; dvc repro or checkout")
        source = ran["meshes"]["source"]
        if licence is None and source != OURS:
            raise InputError(f"--licence: missing; the network was trained on meshes of {source}, which have their own")
        config = _config(run, read_config(folder), ran, _metrics(lock, run), licence or LICENCE)
        config["name"] = out.resolve().name
        out.mkdir(parents=True, exist_ok=True)
        with atomic(out / WEIGHTS) as temporary:
            shutil.copyfile(folder / WEIGHTS, temporary)
        with atomic(out / NETWORK) as temporary:
            write_onnx(temporary, load_network(folder), read_network(folder).channels)
        config["onnx_sha256"] = hashlib.sha256((out / NETWORK).read_bytes()).hexdigest()
        with atomic(out / CONFIG) as temporary:
            temporary.write_text(json.dumps(config, indent=2) + "\n", encoding="utf-8")
        with atomic(out / CARD) as temporary:
            temporary.write_text(card(config), encoding="utf-8")
        GraspPlanner.load(out)
    except OSError as error:
        raise InputError(f"{error.filename or out}: {error.strerror}") from None
    except InputError:
        raise
    except ValueError as error:  # ParameterError, WeightsError, ModelError
        raise InputError(str(error)) from None
    told = "" if config["metrics"] else f"; without metrics: {_metrics_file(lock)} is missing, or of another run"
    return f"{out}: a model of {run}{told}"


def _default_run(lock: dict[str, Any]) -> str:
    """Of the networks that take any camera (else of all) the one that the report has as best, or the first."""
    params, every = read_yaml(Path("params.yaml")), _table(_report(lock))
    try:
        networks: list[str] = params["networks"]
        networks = [name for name in networks if params["network"][name].get("input") == "height_map"] or networks
        success = {name: every[name]["robust_best_grasp"]["mean_success"] for name in networks if name in every}
        return f"{max(networks, key=lambda name: success.get(name, 0.0))}-{params['training_seeds'][0]}"
    except (KeyError, IndexError, TypeError):
        raise ParameterError("params.yaml: takes networks, network and training_seeds") from None


def _metrics_file(lock: dict[str, Any]) -> Path:
    """That the report stage wrote, in the folder of its scale."""
    wrote = [Path(path) for path in _files(lock, "report", "outs")]
    return next((path for path in wrote if path.name == "metrics.json"), Path("reports/metrics.json"))


def _report(lock: dict[str, Any]) -> dict[str, Any]:
    """metrics.json; nothing where there is none."""
    path = _metrics_file(lock)
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return found


def _table(report: dict[str, Any]) -> dict[str, Any]:
    """What a report says of all test objects."""
    every: dict[str, Any] = report["table1"]["all"] if report else {}
    return every


def _ran(lock: dict[str, Any], run: str) -> dict[str, Any]:
    """The parameters that the network came from, and the md5 of its weights."""
    ran: dict[str, Any] = {}
    for stage in ("select_meshes", "place_objects", "label_grasps@train", "augment", f"train@{run}", f"predict@{run}"):
        if stage not in lock:
            raise InputError(f"{LOCK}: says nothing of stage {stage}; dvc repro")
        ran |= lock[stage].get("params", {}).get("params.yaml", {})
    ran |= lock["evaluate"]["params"]["params.yaml"] if "evaluate" in lock else {}
    ran["scale"] = lock.get("report", {}).get("params", {}).get("params.yaml", {}).get("scale")
    outs = _files(lock, f"train@{run}", "outs")
    missing = [key for key in ("table", "plan", "gripper", "physics") if key not in ran]
    if missing:
        raise InputError(f"{LOCK}: says nothing of {missing[0]}; dvc repro")
    return ran | {"md5": outs.get(str(NETWORKS / run / WEIGHTS))}


def _files(lock: dict[str, Any], stage: str, kind: str) -> dict[str, str]:
    """md5 of every path that a stage wrote (outs) or read (deps)."""
    return {entry["path"]: entry["md5"] for entry in lock.get(stage, {}).get(kind, [])}


def _reported(lock: dict[str, Any], run: str) -> bool:
    """Whether the report is about this network: every stage on the way read what the one before wrote."""
    metrics = _metrics_file(lock)
    if not metrics.is_file() or _files(lock, "report", "outs").get(str(metrics)) != _md5(metrics):
        return False
    network = {path.name: _md5(path) for path in (NETWORKS / run).iterdir()}
    predicts = [stage for stage in lock if stage.startswith("predict@")]
    wrote = [file for stage in predicts for file in _files(lock, stage, "outs").items()]
    functions = {Path(path).name: md5 for path, md5 in wrote if (FUNCTIONS / Path(path).name).is_file()}
    return (
        _files(lock, f"predict@{run}", "deps").get(str(NETWORKS / run)) == _tree(network)
        and _files(lock, "evaluate", "deps").get(str(FUNCTIONS)) == _tree(functions)
        and _files(lock, "evaluate", "outs").get(TRIALS) == _files(lock, "report", "deps").get(TRIALS)
    )


def _tree(files: dict[str, str]) -> str:
    """The md5 that DVC gives a folder, of its files' names and md5s."""
    listed = [{"md5": md5, "relpath": name} for name, md5 in sorted(files.items())]
    return f"{hashlib.md5(json.dumps(listed, sort_keys=True).encode(), usedforsecurity=False).hexdigest()}.dir"


def _metrics(lock: dict[str, Any], run: str) -> dict[str, Any] | None:
    """How many objects it learned from, and success on the test objects, where the report is of this run."""
    if not _reported(lock, run):
        return None
    report = _report(lock)
    every, name = _table(report), run.rpartition("-")[0]
    if name not in every:
        return None
    counts = {"train_objects": report["labels"]["objects"], "test_objects": every["objects"]}
    methods = {"robust": every[name]["robust_best_grasp"], "best": every[name]["best_grasp"]}
    true = slug(TRUE)
    ceiling = {"ceiling": every[true]["robust_best_grasp"]} if true in every else {}
    return {**counts, **methods, "centroid": every["centroid"], **ceiling}


def _config(
    run: str, network: dict[str, Any], ran: dict[str, Any], metrics: dict[str, Any] | None, licence: str
) -> dict[str, Any]:
    seen = {"fewest_px": FEWEST_PX, "max_tilt_deg": ran["table"]["max_tilt_deg"], "trained_with": ran["camera"]}
    training = {
        key: ran[key] for key in ("scale", "meshes", "settle", "label", "attempt", "augment", "train") if key in ran
    }
    return {
        "format": FORMAT,
        "run": run,
        "licence": licence,
        "network": {"input": "depth"} | network["network"],
        "grid": GRID,
        "camera": seen,
        **{key: ran[key] for key in ("table", "gripper", "plan", "physics", "noise")},
        "training": training | {"seed": ran["seed"], "training_seed": int(run.rpartition("-")[2])},
        "metrics": metrics,
        "versions": {name: importlib.metadata.version(name) for name in PACKAGES},
    }


def _md5(path: Path) -> str:
    return hashlib.md5(path.read_bytes(), usedforsecurity=False).hexdigest()
