"""Tables 1 and 2 of the paper from tables of trials, and what stands under them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from graspfn.evaluation.planner import TRUE
from graspfn.evaluation.statistics import proportion, resampled_rate
from graspfn.planning.methods import BEST, LIKELIEST, METHODS
from graspfn.reporting import paper
from graspfn.reporting.differences import EXPECTED, differences
from graspfn.reporting.plans import ALL, CELL, GRASPABLE, blocks, per_object
from graspfn.robot.trial import INJECTED

TABLE_1_COLUMNS = [
    "objects_of",
    "method",
    "network",
    "sigma_theta_deg",
    "sigma_uv_mm",
    "success",
    "ci_low",
    "ci_high",
    "trials",
    "objects",
    "networks",
    "no_grasp",
    "expected",
    "expected_error",
    "promise",
    "paper",
]
TABLE_2_COLUMNS = [
    "method",
    "sigma_uv_mm",
    "sigma_theta_deg",
    "success",
    "ci_low",
    "ci_high",
    "trials",
    "no_grasp",
    "objects",
    "paper",
    "simulated",
]
_KEY = ["method", "network", "sigma_theta_deg", "sigma_uv_mm"]
SHORT = {LIKELIEST: (BEST, "likeliest class")}  # what such a method is a kind of, and which


def kind(method: str) -> str:
    """The method of the paper that a method is or varies."""
    return SHORT.get(method, (method, ""))[0]


def full_name(method: str, network: str) -> str:
    """A method together with the network it plans with: "Best Grasp (fcn)", "Best Grasp (fcn, likeliest class)"."""
    name, which = SHORT.get(method, (method, ""))
    particulars = ", ".join(filter(None, (network, which)))
    return f"{name} ({particulars})" if particulars else name


def _known(trials: pd.DataFrame) -> None:
    unknown = sorted(set(trials["method"]) - set(METHODS))
    if unknown:
        raise ValueError(f"trials: method {unknown[0]!r} is not one of {', '.join(METHODS)}")


def _order(row: dict[str, Any]) -> tuple[Any, ...]:
    """The paper's; the true function stands after the networks."""
    return METHODS.index(row["method"]), row["network"] == TRUE, row["network"], *(row.get(name, 0) for name in CELL)


def _rates(trials: pd.DataFrame, objects: str) -> list[dict[str, Any]]:
    """One row per method, network and cell, in the paper's order; `objects` is the column that names them."""
    _known(trials)
    rows = []
    for key, group in trials.groupby(_KEY):
        rate = proportion(group["success"].to_numpy(), group[objects].to_numpy())
        rows.append(
            dict(zip(_KEY, key, strict=True))
            | {
                "success": rate.value,
                "ci_low": rate.low,
                "ci_high": rate.high,
                "trials": rate.trials,
                "no_grasp": int(group["u_m"].isna().sum()),
                "objects": rate.clusters,
            }
        )
    return sorted(rows, key=_order)


def _summary(plans: pd.DataFrame) -> dict[str, Any]:
    """Of one method and network: success over objects and training seeds, expectation and promise.

    expected_error: of the mean over these objects, by the attempts that it was reckoned from; in one cell alone. For
    the true function too small, by up to a third.
    """
    rate = resampled_rate(per_object(plans).to_numpy())
    expected, errors = plans["expected"], plans["expected_error"]
    return {
        "success": rate.value,
        "ci_low": rate.low,
        "ci_high": rate.high,
        "trials": int(plans["trials"].sum()),
        "objects": rate.objects,
        "networks": rate.networks,
        "no_grasp": int(plans["no_grasp"].sum()),
        "expected": float(expected.mean()),
        "expected_error": float(np.sqrt((errors**2).sum())) / expected.count() if expected.count() else np.nan,
        "promise": float(plans["promise"].mean()),
    }


def _summaries(column: str, groups: Mapping[str, pd.DataFrame], by: list[str]) -> list[dict[str, Any]]:
    """A row for each group of plans, whose name stands in `column`, and each value of the columns `by`, in order."""
    found: list[dict[str, Any]] = []
    for name, table in groups.items():
        _known(table)
        rows = [{column: name} | dict(zip(by, key, strict=True)) | _summary(group) for key, group in table.groupby(by)]
        found += sorted(rows, key=_order)
    return found


def table1(plans: pd.DataFrame, graspable: Collection[str]) -> pd.DataFrame:
    """Success of every method, network and cell, beside the paper's, for each block of objects (TABLE_1_COLUMNS).

    plans: as `plans_of` has them; graspable: the objects of the second block. networks: trained with a seed each;
    no_grasp: of the trials, those where the method found no pose to try. The true function has rows where objects are
    labelled.
    """
    rows = _summaries("objects_of", blocks(plans, graspable), _KEY)
    for row in rows:
        row["paper"] = paper.table_1(kind(row["method"]), row["sigma_uv_mm"], row["sigma_theta_deg"])
    return pd.DataFrame(rows, columns=TABLE_1_COLUMNS)


def means1(plans: pd.DataFrame, graspable: Collection[str]) -> pd.DataFrame:
    """Table 1's columns but for the cells, over all of which these are means; paper: NaN unless it has every cell."""
    rows = _summaries("objects_of", blocks(plans, graspable), _KEY[:2])
    cells = plans[CELL].drop_duplicates().to_numpy()
    for row in rows:
        del row["expected_error"]  # one object's attempts serve all cells
        row["paper"] = float(np.mean([paper.table_1(kind(row["method"]), uv, theta) for theta, uv in cells]))
    return pd.DataFrame(rows)


def by_source(plans: pd.DataFrame, source: Mapping[str, str]) -> pd.DataFrame:
    """Means over all cells of Table 1 for the objects of each source: source, method, network, success and so on.

    source: where each object comes from, by id.
    """
    groups = {str(name): group for name, group in plans.groupby(plans["id"].map(source))}
    return pd.DataFrame(_summaries("source", groups, _KEY[:2]))


@dataclass(frozen=True, eq=False)
class Tables1:
    """Table 1 (TABLE_1_COLUMNS), the means over its cells, those for each source of test objects, and differences."""

    cells: pd.DataFrame
    means: pd.DataFrame
    sources: pd.DataFrame
    differences: pd.DataFrame

    @classmethod
    def of(cls, plans: pd.DataFrame, graspable: Collection[str], source: Mapping[str, str]) -> Tables1:
        cells, means = table1(plans, graspable), means1(plans, graspable)
        return cls(cells, means, by_source(plans, source), differences(plans, graspable))


def table2(robot_trials: pd.DataFrame) -> pd.DataFrame:
    """Success rate of every method (with its network) in every condition of a robot (TABLE_2_COLUMNS)."""
    rows = _rates(robot_trials, "object")
    simulated = robot_trials.groupby(_KEY)["simulated"].any()
    for row in rows:
        row["simulated"] = bool(simulated[tuple(row[name] for name in _KEY)])
        row["paper"] = paper.table_2(row["method"], row["sigma_uv_mm"], row["sigma_theta_deg"])
        row["method"] = full_name(row["method"], row["network"])
    return pd.DataFrame(rows, columns=TABLE_2_COLUMNS)


def _span(numbers: pd.Series) -> str:
    low, high = int(numbers.min()), int(numbers.max())
    return f"{low}" if low == high else f"{low} to {high}"


def who_recorded(robot_trials: pd.DataFrame) -> str:
    """One plain sentence on whether a simulated or a real robot made the recordings."""
    count, simulated = len(robot_trials), int(robot_trials["simulated"].sum())
    if simulated == count:
        return f"All {count} recordings were made by a simulated robot: no real arm was involved."
    if simulated:
        return f"{simulated} of the {count} recordings were made by a simulated robot, the others by a real one."
    return f"All {count} recordings were made by a real robot."


def _without_a_grasp(table: pd.DataFrame) -> str:
    """How many trials failed because there was no pose to try; nothing where there was one in all."""
    count = int(table["no_grasp"].sum())
    if not count:
        return ""
    return f"In {count:,} of the {int(table['trials'].sum()):,} trials the method found no grasp, which is a failure. "


def _pooled(robot_trials: pd.DataFrame) -> str:
    """Where a cell holds trials with different errors added on purpose; nothing where none does."""
    if not {*INJECTED} <= set(robot_trials):
        return ""
    kinds = robot_trials.groupby(CELL)[list(INJECTED)].apply(lambda cell: len(cell.drop_duplicates()))
    if kinds.max() == 1:
        return ""
    return f"{int((kinds > 1).sum())} of the conditions pool trials with different errors injected on purpose. "


def block_name(block: str, objects: int) -> str:
    """All 80 test objects; The 62 test objects that can be held."""
    some = f"{objects:,} test object{'s' * (objects != 1)}"
    return f"All {some}" if block == ALL else f"The {some} that can be held"


def block_names(table: pd.DataFrame) -> dict[str, str]:
    """What the blocks of Table 1 are called, with their numbers of objects."""
    count = table.groupby("objects_of")["objects"].max()
    return {block: block_name(block, int(count[block])) for block in dict.fromkeys(table["objects_of"])}


def floor_and_ceiling(table: pd.DataFrame) -> str:
    """What stands below and above every network; table: Table 1."""
    own = table[(table["network"] == TRUE) & (table["objects_of"] == ALL)]
    if own.empty:
        return "Centroid, which needs no network, is the floor. No test object is labelled: there is no ceiling. "
    labelled = int(own["objects"].max())
    among = "" if labelled == table["objects"].max() else f" (known for {labelled:,} test objects, the labelled ones)"
    return (
        "Centroid, which needs no network, is the floor; the true function, the labels of the very object, is the "
        f"ceiling{among}. "
    )


def what_intervals_hold(table: pd.DataFrame) -> str:
    """Which chances the intervals of Table 1 hold, and which not."""
    networks = int(table["networks"].max())
    if networks > 1:
        return f"95% intervals from resampling objects and the {networks} training seeds of each network"
    return (
        "95% intervals from resampling objects; each network was trained once, and what another start of it would "
        "bring they do not hold"
    )


def caption1(table: pd.DataFrame, scale: str) -> str:
    """What Table 1 shows, with its counts and scale."""
    errors = table["trials"] // (table["objects"] * table["networks"])
    held = ""
    if GRASPABLE in set(table["objects_of"]):
        held = (
            "Those that can be held are the labelled ones with a pose at which every attempt held: the labels decide, "
            "never a trial. "
        )
    return (
        f"Table 1. Success rate in simulation under gripper pose uncertainty, scale “{scale}”: "
        f"{' and '.join(name[0].lower() + name[1:] for name in block_names(table).values())}, each with "
        f"{_span(errors)} {'error' if errors.max() == 1 else 'errors'} in every cell, the same for all methods. {held}"
        f"{floor_and_ceiling(table)}{_without_a_grasp(table[table['objects_of'] == ALL])}"
        f"Brackets: {what_intervals_hold(table)}. Rows (paper): the figures printed by Johns, Leutenegger and Davison "
        "(2016), on 1000 objects of ModelNet and without intervals; its Best Grasp takes the likeliest class."
    )


def caption_means(table: pd.DataFrame) -> str:
    """What stands under the means of Table 1; table: those."""
    return (
        "Means over all cells of Table 1. Promise: the robust score of the commanded pose, by the function that "
        "planned it. Expected: the success of that pose by the object's own labelled attempts, of labelled objects and "
        "where enough attempts lie near; for the true function, of poses planned without the attempts that judge them. "
        f"Brackets: {what_intervals_hold(table)}."
    )


def caption_differences(table: pd.DataFrame) -> str:
    """What stands under the differences; table: of `differences`."""
    known = table.loc[table["by"] == EXPECTED, "objects"]
    judged = f", those of {int(known.max()):,} labelled objects" if len(known) else ""
    return (
        "Methods in Table 1 against each other, paired object by object: by trials, and as expected of the same "
        f"commanded poses by the labelled attempts{judged}, which chance blurs far less. The ceiling is Robust Best "
        "Grasp with the true function; as expected, of other poses: planned by most of the attempts and judged "
        "by the rest, so that it comes out a little low, and the share of it that is reached, Robust / Ceiling, a "
        "little high. Mean: of differences over cells; of shares, the share of the means. Above 0: the cells whose "
        "interval lies there. "
        f"Brackets: {what_intervals_hold(table)}."
    )


def _few_labelled(table: pd.DataFrame) -> str:
    """Of how many objects of each source the true function is known, where not of all; table: of `by_source`."""
    known = table[table["network"] == TRUE].groupby("source")["objects"].max()
    if known.empty or known.equals(table.groupby("source")["objects"].max()[known.index]):
        return ""
    return f"The true function is known of {', '.join(f'{n} of {source}' for source, n in known.items())}. "


def caption_sources(table: pd.DataFrame, learned_from: Collection[str]) -> str:
    """What stands under the means by source; table: of `by_source`; learned_from: the sources of training objects."""
    return (
        "Means over all cells of Table 1 for the test objects of each source, with their number. The networks learned "
        f"from objects of {', '.join(sorted(learned_from))}. {_few_labelled(table)}"
        f"Brackets: {what_intervals_hold(table)}."
    )


def caption2(table: pd.DataFrame, robot_trials: pd.DataFrame, scale: str) -> str:
    """What Table 2 shows, with its counts and scale, and who made the recordings."""
    return (
        f"Table 2. Success rate on a robot, scale “{scale}”: {_span(table['trials'])} trials in each cell, on "
        f"{_span(table['objects'])} objects. {who_recorded(robot_trials)} "
        f"{_without_a_grasp(table)}{_pooled(robot_trials)}"
        "Brackets: 95% intervals with objects as clusters. Rows (paper): the figures printed by Johns, Leutenegger and "
        "Davison (2016), measured on a real Kinova MICO with 20 objects in five placements."
    )
