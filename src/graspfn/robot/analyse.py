"""From bags to a table of trials and the pose uncertainty that the robot showed (paper VII-B).

The paper measures its arm's uncertainty from commanded and achieved poses; so does this (`spread`). What the planner
assumed and what was injected on purpose are conditions of a trial; what is measured is neither. A bag that cannot be
used costs itself alone, and is named with its reason.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from graspfn.geometry.grid import angle_difference
from graspfn.params import Arm, Compute, Topics
from graspfn.robot.described import TABLE
from graspfn.robot.judged import LIFTED_M
from graspfn.robot.read import ARM, read_trial
from graspfn.robot.spread import AXES, PAIRS, Estimate, Spread, spread
from graspfn.robot.trial import INJECTED, RecordingError
from graspfn.workflow.parallel import map_in_order

if TYPE_CHECKING:
    from graspfn.robot.replan import Replanner  # torch takes a second to load, and not all plan again

ASSUMED = ["sigma_uv_mm", "sigma_theta_deg"]
CONDITION = [*ASSUMED, *INJECTED]
TRIAL = ["object", "placement", "method", "network", *CONDITION, "session"]
WORTH_PROCESSES = 30  # bags; fewer are read before processes have started
FEW = 3  # bags that a line names one by one
UNITS = dict(zip(AXES, ("mm", "mm", "deg"), strict=True))


@dataclass(frozen=True, eq=False)
class Measured:
    """Sigma of one condition. label: which; outliers: names of the bags whose errors are none of the others' kind."""

    label: str
    spread: Spread
    outliers: tuple[str, ...]

    def text(self) -> str:
        """A few lines for people."""
        s = self.spread
        lines = [f"{self.label}: {s.rows} errors in {s.sessions} session{'s' * (s.sessions != 1)}"]
        for i, (axis, unit) in enumerate(UNITS.items()):
            lines.append(f"  {axis:5}  sigma {s.sigma[i]} {unit}, bias {s.bias[i]} {unit}")
        lines.append(f"  correlation of u and v {s.correlation[0]}; Gaussian: p = {s.normality:.2g}")
        if self.outliers:
            lines.append(f"  outliers, left out of these: {', '.join(self.outliers)}")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class Analysis:
    """trials: a row per usable bag, sorted by what was tried. uncertainty: a row per condition, of `measured`. unused:
    file and reason of every bag that is not among the trials."""

    trials: pd.DataFrame
    uncertainty: pd.DataFrame
    unused: pd.DataFrame
    measured: tuple[Measured, ...]

    def oddities(self) -> list[str]:
        """A line for every trial whose reached pose measures nothing, or whose image gives another plan now, and for
        every flag, of how many bags."""
        trials = self.trials.to_dict("records")
        lines = [f"{t['file']}: not in Sigma: {t['doubts']}" for t in trials if t["doubts"]]
        lines += [f"{t['file']}: {t['replanned']}" for t in trials if t["replanned"]]
        flagged = self.trials[self.trials["flags"] != ""]
        for flag, files in flagged.groupby("flags")["file"]:
            lines.append(f"{', '.join(files) if len(files) <= FEW else f'{len(files)} bags'}: {flag}")
        return lines

    def reasons(self) -> str:
        """How many trials failed, and why, as far as fingers and lift tell; "" where none did."""
        failed = self.trials[~self.trials["success"].astype(bool)]
        if failed.empty:
            return ""
        why = failed["why"].str.replace(r"by -?\d+ mm", f"by less than {LIFTED_M * 1000:g} mm", regex=True)
        counts = why.replace("", "the recording does not tell why").value_counts().sort_index()
        return f"{len(failed)} of {len(self.trials)} trials failed: " + ", ".join(f"{n} {w}" for w, n in counts.items())

    def check(self, max_failed: float) -> None:
        """RecordingError where no trial is left, or more than this share of the bags could not be used."""
        bags = len(self.trials) + len(self.unused)
        if not bags:
            raise RecordingError("no recordings to analyse")
        if len(self.trials) == 0 or len(self.unused) > max_failed * bags:
            allowed = f", more than robot.max_failed allows ({max_failed:g})" if len(self.trials) else ""
            first = self.unused["reason"].iloc[0]
            raise RecordingError(f"{len(self.unused)} of {bags} bags cannot be used{allowed}; the first: {first}")


def trial_row(
    path: Path,
    topics: Topics,
    arm: Arm = ARM,
    row: Mapping[str, str] | None = None,
    name: str = "",
    again: Replanner | None = None,
) -> dict[str, object]:
    """One row of the trials' table from one bag, by its name; its poses are NaN where the method found no grasp.

    again: plans on the recorded image once more; where the pose is another, `replanned` says so.
    """
    trial = read_trial(path, topics, arm, row)
    c = trial.condition
    nowhere = np.full(3, np.nan)
    u, v, theta = (nowhere if trial.commanded is None else trial.commanded).tolist()
    reached_u, reached_v, reached_theta = (nowhere if trial.achieved is None else trial.achieved).tolist()
    injected = {name: getattr(c, name) for name in INJECTED}
    return {
        "file": name or path.name,
        "object": c.object,
        "placement": c.placement,
        "method": c.method,
        "network": c.network,
        "sigma_uv_mm": c.sigma_uv_mm,
        "sigma_theta_deg": c.sigma_theta_deg,
        **{name: np.nan if value is None else value for name, value in injected.items()},
        "session": c.session,
        "u_m": u,
        "v_m": v,
        "theta_rad": theta,
        "reached_u_m": reached_u,
        "reached_v_m": reached_v,
        "reached_theta_rad": reached_theta,
        "success": trial.success,
        "judged": {None: "", True: "held", False: "failed"}[trial.judged],
        "why": trial.why,
        "simulated": c.simulated,
        "flags": "; ".join(trial.flags),
        "doubts": "; ".join(trial.doubts),
        "replanned": again.differs(trial) if again else "",
    }


def pose_errors(trials: pd.DataFrame) -> np.ndarray:
    """(n, 3) reached less commanded: u [m], v [m], theta [rad] in [-pi/2, pi/2)."""
    uv = trials[["reached_u_m", "reached_v_m"]].to_numpy() - trials[["u_m", "v_m"]].to_numpy()
    theta = angle_difference(trials["reached_theta_rad"].to_numpy(), trials["theta_rad"].to_numpy())
    return np.column_stack([uv, theta])


def independent(trials: pd.DataFrame) -> pd.DataFrame:
    """The trials with one row per draw of the arm's error.

    Methods may be compared under the same errors on the same placement of an object; such an error is one
    observation of the arm, however many trials it served. A trial without a grasp to try is none.
    """
    trials = trials[trials["u_m"].notna()]
    keyed = trials[["object", "placement"]].copy()
    keyed[["u", "v", "theta"]] = pose_errors(trials).round(9)  # a nanometre: what adding to commands rounds off
    return trials[~keyed.duplicated().to_numpy()]


def people_units(errors: np.ndarray) -> np.ndarray:
    """errors (n, 3) [m, m, rad] in mm and degrees, their angles within a quarter turn of the mean on the circle of
    half turns, so that an error that wraps counts as the small one it is.

    Errors beyond 90 degrees cannot be told from smaller ones: a spread above some 30 degrees comes out too low.
    """
    mean = float(np.angle(np.exp(2j * errors[:, 2]).mean())) / 2 if len(errors) else 0.0
    theta = mean + angle_difference(errors[:, 2], np.array(mean))
    return np.column_stack([errors[:, :2] * 1000, np.degrees(theta)])


def _columns(name: str, estimate: Estimate) -> dict[str, float]:
    return {name: estimate.value, f"{name}_low": estimate.low, f"{name}_high": estimate.high}


def uncertainty_row(found: Spread) -> dict[str, float]:
    """A Spread as columns: estimated_<axis>_<unit>, bias_..., correlation_..., each with _low and _high."""
    row: dict[str, float] = {}
    for i, (axis, unit) in enumerate(UNITS.items()):
        row |= _columns(f"estimated_{axis}_{unit}", found.sigma[i]) | _columns(f"bias_{axis}_{unit}", found.bias[i])
        row[f"sessions_{axis}_{unit}"] = float(found.sessions_sigma[i])
    row |= _columns("estimated_uv_mm", found.sigma_uv)
    for (i, j), estimate in zip(PAIRS, found.correlation, strict=True):
        row |= _columns(f"correlation_{AXES[i]}_{AXES[j]}", estimate)
    return row | {"normality": found.normality}


def label(assumed: tuple[float, float], injected: tuple[float, float]) -> str:
    """A condition in words: what was injected, where that is known, else what was assumed."""
    told = "assumed" if np.isnan(injected[0]) else "injected"
    uv, theta = assumed if told == "assumed" else injected
    return f"{uv:g} mm, {theta:g}° {told}"


def measure(trials: pd.DataFrame) -> tuple[pd.DataFrame, tuple[Measured, ...]]:
    """Sigma of each condition: of what was injected, or where nobody knows, of what was assumed."""
    known = trials[INJECTED[0]].notna()
    keys = trials[list(INJECTED)].assign(**{name: trials[name].mask(known) for name in ASSUMED})
    rows, measured = [], []
    for _, group in trials.groupby([keys[name] for name in keys], dropna=False, sort=True):
        draws = independent(group[group["doubts"] == ""])
        found = spread(people_units(pose_errors(draws)), draws["session"].to_numpy())
        assumed, injected = ((float(group[a].iloc[0]), float(group[b].iloc[0])) for a, b in (ASSUMED, INJECTED))
        name = label(assumed, injected)
        outliers = tuple(draws["file"][found.outliers])
        row: dict[str, object] = {"condition": name, **dict(zip(INJECTED, injected, strict=True))}
        row |= dict[str, object](uncertainty_row(found))
        row |= {"trials": len(group), "draws": len(draws), "sessions": found.sessions, "outliers": ", ".join(outliers)}
        rows.append(row)
        measured.append(Measured(name, found, outliers))
    return pd.DataFrame(rows), tuple(measured)


def each_bag(
    function: Callable[..., Any], tasks: Sequence[tuple[str, tuple[Any, ...]]], compute: Compute | None
) -> Iterator[tuple[str, Any]]:
    """function(*arguments) of every (name, arguments), in their order: (name, result), or the RecordingError of a bag.

    Bags lie on this machine: no cluster reads them. One that takes its process down costs itself alone.
    """
    if compute is not None and len(tasks) >= WORTH_PROCESSES:
        here = dataclasses.replace(compute, address=None)
        for name, result in map_in_order(function, tasks, len(tasks), here, None):
            if isinstance(result, Exception) and not isinstance(result, RecordingError | RuntimeError):
                raise result
            yield name, result
        return
    for name, arguments in tasks:
        try:
            yield name, function(*arguments)
        except RecordingError as error:
            yield name, error


def analyse(
    paths: Iterable[Path],
    topics: Topics,
    arm: Arm = ARM,
    table: Mapping[Path, Mapping[str, str]] | None = None,
    folder: Path | None = None,
    again: Replanner | None = None,
    compute: Compute | None = None,
) -> Analysis:
    """What stays of each bag is its row, whichever process read it.

    table: what trials.csv says (`read_table`). folder: in which bags are named by their path, else by their own name.
    again: see `trial_row`. compute: how many processes read; None: this one.
    """

    def name(path: Path) -> str:
        return path.relative_to(folder).as_posix() if folder and path.is_relative_to(folder) else path.name

    rows: list[dict[str, object]] = []
    unused, left = [], dict(table or {})
    tasks = [(name(path), (path, topics, arm, left.pop(path, None), name(path), again)) for path in sorted(paths)]
    for bag, found in each_bag(trial_row, tasks, compute):
        if isinstance(found, Exception):
            unused.append({"file": bag, "reason": str(found)})
        else:
            rows.append(found)
    unused += [{"file": name(bag), "reason": f"{bag}: {TABLE} names it, but there is no such bag"} for bag in left]
    trials = pd.DataFrame(rows)
    if len(rows):
        trials = trials.sort_values([*TRIAL, "file"], ignore_index=True)
        second_time = trials.duplicated(TRIAL)
        for i in np.flatnonzero(second_time):
            first, second = trials["file"][i - 1], trials["file"][i]
            reason = f"{second}: the same trial as {first} ({', '.join(TRIAL)} agree)"
            unused.append({"file": second, "reason": reason})
        trials = trials[~second_time].reset_index(drop=True)
    uncertainty, measured = measure(trials) if len(rows) else (pd.DataFrame(), ())
    return Analysis(trials, uncertainty, pd.DataFrame(unused, columns=["file", "reason"]), measured)
