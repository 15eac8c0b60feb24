"""What a trial was, which no ROS topic says: from the bag's own metadata record `graspfn.trial`, from the file
`<bag>.trial.yaml` beside it, from the folder's `trials.csv`. Of each key the first of these that has it counts.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping
from pathlib import Path

import yaml

from graspfn.robot.bag import open_bag
from graspfn.robot.trial import METADATA, REQUIRED, RecordingError, check
from graspfn.workflow.files import atomic

TABLE = "trials.csv"
BAG = "bag"  # its column that names the bag
MOST_BYTES = 1 << 22


def sidecar(bag: Path) -> Path:
    """Where the description of a bag lies: beside it, also where it is a folder."""
    return bag.with_name(f"{bag.name}.trial.yaml")


def _text(path: Path) -> str:
    try:
        if not path.is_file() or path.stat().st_size > MOST_BYTES:
            raise RecordingError(f"{path}: takes a file of up to {MOST_BYTES >> 20} MiB")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise RecordingError(f"{path}: not UTF-8") from None


def read_sidecar(bag: Path) -> dict[str, str]:
    """The keys of a bag's sidecar, every value as it is typed; none where there is no such file."""
    path = sidecar(bag)
    if not path.exists():
        return {}
    try:
        values = yaml.load(_text(path), yaml.BaseLoader)
    except yaml.YAMLError as error:
        raise RecordingError(f"{path.name}: not YAML: {' '.join(str(error).split())}") from None
    except RecursionError:
        raise RecordingError(f"{path.name}: not YAML: nested too deep") from None
    if not isinstance(values, dict) or not all(isinstance(item, str) for pair in values.items() for item in pair):
        raise RecordingError(f"{path.name}: takes lines of key: value")
    return values


def read_table(folder: Path) -> dict[Path, dict[str, str]]:
    """What trials.csv of a folder says of each of its bags; empty cells say nothing.

    RecordingError for a table that cannot be read, or has two lines of one bag.
    """
    path = folder / TABLE
    if not path.exists():
        return {}
    try:
        lines = list(csv.DictReader(io.StringIO(_text(path)), strict=True))
    except csv.Error as error:
        raise RecordingError(f"{path}: not CSV: {error}") from None
    rows: dict[Path, dict[str, str]] = {}
    for number, line in enumerate(lines, start=2):
        name = line.pop(BAG, None)
        if not name:
            raise RecordingError(f"{path}: line {number} has no {BAG!r}, the column that names the bag")
        bag = folder / name
        if bag in rows:
            raise RecordingError(f"{path}: line {number} is the second of {name}")
        if None in line or None in line.values():
            raise RecordingError(f"{path}: line {number} has not as many cells as the first line")
        rows[bag] = {key: value for key, value in line.items() if value}
        if "network" in line:
            rows[bag]["network"] = line["network"]  # none, of Centroid, is said by an empty cell
    return rows


def read_tables(folder: Path, bags: Iterable[Path]) -> dict[Path, dict[str, str]]:
    """What the trials.csv of a folder, and of the folders in it that hold bags, say; the nearest to a bag counts."""
    rows: dict[Path, dict[str, str]] = {}
    for place in sorted({folder, *(bag.parent for bag in bags)}):
        rows |= read_table(place)
    return rows


def description(bag: Path, metadata: Mapping[str, Mapping[str, str]], row: Mapping[str, str]) -> dict[str, str]:
    """What the trial in a bag was. metadata: the MCAP records of the bag; row: that of trials.csv."""
    sources = {
        "metadata record 'graspfn.trial'": dict(metadata.get(METADATA, {})),
        sidecar(bag).name: read_sidecar(bag),
        TABLE: dict(row),
    }
    said: dict[str, str] = {}
    for name, source in sources.items():
        try:
            check(source)
        except RecordingError as error:
            raise RecordingError(f"{name}: {error}") from None
        said = source | said
    if not said:
        needed = "; ".join(f"{key}: {meaning}" for key, meaning in REQUIRED.items())
        raise RecordingError(
            f"nothing says what the trial was: no metadata record {METADATA!r}, no {sidecar(bag).name}, no line of "
            f"{TABLE}; `graspfn trial {bag.name} key=value ...` writes it, with the keys {needed}"
        )
    return said


def describe(bag: Path, changes: Mapping[str, str]) -> dict[str, str]:
    """Write changes into the sidecar of a bag, and give all that it says then; an empty value but for `network`
    takes a key out. RecordingError for a bag or a key that is not."""
    if not bag.exists():
        raise RecordingError(f"{bag}: no such file or folder")
    kept = {key: value for key, value in {**read_sidecar(bag), **changes}.items() if value or key == "network"}
    check(kept)
    with atomic(sidecar(bag)) as part:
        part.write_text(yaml.safe_dump(kept, allow_unicode=True, sort_keys=False), encoding="utf-8")
    return kept


def undescribed(bag: Path, said: Mapping[str, str]) -> list[str]:
    """What the sidecar of a bag does not settle: keys that no source has, keys that the bag itself has otherwise."""
    try:
        with open_bag(bag, (), ()) as opened:
            own = opened.metadata.get(METADATA, {})
        row = read_table(bag.parent).get(bag, {})
    except (RecordingError, OSError) as error:
        return [f"{bag}: {error}"]
    lines = [
        f"{key}: the bag itself says {own[key]!r}, and that counts"
        for key in said
        if own.get(key, said[key]) != said[key]
    ]
    missing = [key for key in REQUIRED if key not in {**own, **said, **row}]
    return lines + ([f"still missing: {', '.join(missing)}"] if missing else [])
