"""The run's results in words, from metrics.json alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from graspfn.evaluation.planner import TRUE
from graspfn.planning.methods import ROBUST
from graspfn.reporting import paper
from graspfn.reporting.differences import EXPECTED, SHARE
from graspfn.reporting.metrics import slug
from graspfn.reporting.plans import block_to_show
from graspfn.reporting.tables import block_name

HEADLINE = "success_uv5_theta10"
Numbers = Mapping[str, Any]


def interval(found: Numbers, digits: int = 2) -> str:
    """Such as " [0.51, 0.62]" of numbers with ci_low and ci_high; nothing where there is none."""
    if found["ci_low"] is None or found["ci_high"] is None:
        return ""
    return f" [{found['ci_low']:.{digits}f}, {found['ci_high']:.{digits}f}]".replace("-", "−")


def gain(found: Numbers) -> str:
    """A difference with its sign and interval: "+0.055 [0.012, 0.097]"; whether that holds 0 is to be seen."""
    return f"{found['value']:+.3f}".replace("-", "−") + interval(found, digits=3)


def _expected(found: Numbers) -> str:
    """The same difference by the labels, where they are known."""
    return f" ({gain(found[EXPECTED])} as the labels lead one to expect)" if EXPECTED in found else ""


def _share(found: Numbers | None) -> str:
    """A sentence on how much of the ceiling is reached by the labels; found: of SHARE."""
    if found is None or EXPECTED not in found:
        return ""
    share = found[EXPECTED]
    least = min(cell["value"] for cell in share["cells"].values())
    reached = f"{share['value']:.3f}{interval(share, digits=3)}"
    return (
        f" By the labels, {ROBUST} reaches {reached} of what planning by them does, and {least:.3f} in the worst cell."
    )


def trained(block: Numbers) -> dict[str, Numbers]:
    """The networks of a block of metrics.json's table1, best Robust Best Grasp first."""
    networks = {name: entry for name, entry in block.items() if isinstance(entry, Mapping) and name != slug(TRUE)}
    found = {name: entry for name, entry in networks.items() if "robust_best_grasp" in entry}
    return dict(sorted(found.items(), key=lambda item: -item[1]["robust_best_grasp"]["mean_success"]))


def results_sentence(metrics: Numbers) -> str:
    """What came out of Table 1, in one paragraph for README.md; metrics: what metrics.json holds."""
    name = block_to_show(metrics["table1"])
    block = metrics["table1"][name]
    network, entry = next(iter(trained(block).items()))
    robust = entry["robust_best_grasp"]
    whom = block_name(name, block["objects"])
    text = (
        f"On {whom[0].lower()}{whom[1:]}, Robust Best Grasp of `{network}` succeeds in {robust['mean_success']:.3f}"
        f"{interval(robust)} of its trials, mean over the cells of Table 1: {gain(entry['robust_minus_best'])} against "
        f"Best Grasp{_expected(entry['robust_minus_best'])} and {gain(entry['robust_minus_centroid'])} against "
        f"Centroid, the floor{_expected(entry['robust_minus_centroid'])}"
    )
    ceiling = block.get(slug(TRUE), {}).get("robust_best_grasp")
    if ceiling and "ceiling_minus_robust" in entry:
        text += f"; the true grasp function, the ceiling, reaches {ceiling['mean_success']:.3f}"
    text += f".{_share(entry.get(SHARE))}"
    if HEADLINE in robust:
        text += f" At σuv = 5 mm, σθ = 10° it succeeds in {robust[HEADLINE]['value']:.3f}"
        if ceiling:
            text += f", the ceiling in {ceiling[HEADLINE]['value']:.3f}"
        text += f"; the paper prints {paper.table_1(ROBUST, 5, 10):.3f}."
    return text


def in_readme(text: str) -> str:
    """The paragraph between the markers of README.md, on one line."""
    inside = text.split("<!-- results -->")[1].split("<!-- /results -->")[0]
    return " ".join(inside.split())
