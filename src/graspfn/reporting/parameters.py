"""Parameters as a flat list for the page."""

from __future__ import annotations

import dataclasses
import typing
from dataclasses import dataclass
from typing import Any

from graspfn.params import Key, Params


@dataclass(frozen=True)
class Parameter:
    """One key of params.yaml."""

    key: str
    value: str
    meaning: str


def _text(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, tuple):
        return ", ".join(_text(item) for item in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _flat(hint: Any, value: Any, key: str, meaning: str) -> list[Parameter]:
    if typing.get_origin(hint) is typing.Annotated:
        hint, rule = typing.get_args(hint)[:2]
        meaning = rule.meaning if isinstance(rule, Key) else meaning
    if dataclasses.is_dataclass(value):
        hints = typing.get_type_hints(type(value), include_extras=True)
        return [p for name in hints for p in _flat(hints[name], getattr(value, name), f"{key}.{name}", meaning)]
    if isinstance(value, dict):
        return [p for name, item in value.items() for p in _flat(None, item, f"{key}.{name}", meaning)]
    return [Parameter(key, _text(value), meaning)]


def flat_parameters(params: Any) -> tuple[Parameter, ...]:
    """Every parameter that can change a result (all but compute), in the order of params.yaml."""
    hints = typing.get_type_hints(Params, include_extras=True)
    return tuple(
        p for name, hint in hints.items() if name != "compute" for p in _flat(hint, getattr(params, name), name, "")
    )
