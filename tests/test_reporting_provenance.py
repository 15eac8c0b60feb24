"""The table of sources counts every object and every rejected mesh once."""

import pandas as pd

from graspfn.reporting.provenance import UNKNOWN, kinds_of_rejects, provenance

REJECTS = pd.DataFrame(
    [
        ("train", "ycb", "chain", "chain", "in pieces: 9, more than a sixteenth of its size apart"),
        ("test", "ycb", "cup", "cup", "copy: it has the shape of ycb-mug, which is to train on"),
        ("test", "ycb", "dice", "dice", "copy: it has the shape of ycb-cube, which is to train on"),
        ("train", "broken", "sheet", "", "flat"),
    ],
    columns=["split", "source", "name", "class", "reason"],
)


def manifest(split, *rows):
    table = pd.DataFrame(rows, columns=["source", "licence", "shape", "mass"])
    return table.assign(split=split)


MANIFESTS = {
    "train": manifest(
        "train",
        ("ycb", "CC BY 4.0", "a", "volume"),
        ("ycb", "CC BY 4.0", "a", "convex hull"),
        ("procedural", "MIT", "b", "volume"),
    ),
    "test": manifest("test", ("ycb", "CC BY 4.0", "c", "convex hull")),
}


def test_every_source_has_a_line_and_all_of_them_another():
    lines = {line.source: line for line in provenance(MANIFESTS, REJECTS)}
    assert list(lines) == ["broken", "procedural", "ycb", "all"]
    ycb = lines["ycb"]
    assert (ycb.licence, ycb.train, ycb.test, ycb.shapes, ycb.hull, ycb.rejected) == ("CC BY 4.0", 2, 1, 2, 2, 3)
    assert lines["broken"].licence == UNKNOWN
    parts = [line for name, line in lines.items() if name != "all"]
    for count in ("train", "test", "shapes", "hull", "rejected"):
        assert getattr(lines["all"], count) == sum(getattr(line, count) for line in parts)


def test_one_source_needs_no_sum():
    alone = {split: table[table["source"] == "ycb"] for split, table in MANIFESTS.items()}
    assert [line.source for line in provenance(alone, REJECTS[REJECTS["source"] == "ycb"])] == ["ycb"]


def test_reasons_are_counted_without_their_particulars_most_frequent_first():
    assert kinds_of_rejects(REJECTS) == [("copy", 2), ("flat", 1), ("in pieces", 1)]
    assert kinds_of_rejects(REJECTS.head(0)) == []
