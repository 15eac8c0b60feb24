"""Where the objects come from: how many of which source under which licence, and which meshes were turned down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from graspfn.meshes.mass import HULL

UNKNOWN = "–"


@dataclass(frozen=True)
class Provenance:
    """One source, or all. shapes: distinct ones; hull: objects with the mass of their convex hull; in objects."""

    source: str
    licence: str
    train: int
    test: int
    shapes: int
    hull: int
    rejected: int


def _line(source: str, licence: str, objects: pd.DataFrame, rejects: pd.DataFrame) -> Provenance:
    return Provenance(
        source=source,
        licence=licence,
        train=int((objects["split"] == "train").sum()),
        test=int((objects["split"] == "test").sum()),
        shapes=objects["shape"].nunique(),
        hull=int((objects["mass"] == HULL).sum()),
        rejected=len(rejects),
    )


def provenance(manifests: Mapping[str, pd.DataFrame], rejects: pd.DataFrame) -> list[Provenance]:
    """A line for every source by name, and one for all of them where there are several."""
    objects = pd.concat(list(manifests.values()))
    names = sorted({*objects["source"], *rejects["source"]})
    lines = []
    for name in names:
        own = objects[objects["source"] == name]
        licence = ", ".join(sorted(set(own["licence"]))) or UNKNOWN
        lines.append(_line(name, licence, own, rejects[rejects["source"] == name]))
    return lines if len(names) == 1 else [*lines, _line("all", "", objects, rejects)]


def kinds_of_rejects(rejects: pd.DataFrame) -> list[tuple[str, int]]:
    """(reason, meshes), most frequent first; of a reason only what stands before its particulars."""
    counts = rejects["reason"].str.split(":").str[0].value_counts()
    return sorted(((str(kind), int(count)) for kind, count in counts.items()), key=lambda line: (-line[1], line[0]))
