"""params.yaml from conf/: Hydra's compose API in, a commented file out."""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
import re
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import yaml
from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from hydra.errors import HydraException
from omegaconf import OmegaConf
from omegaconf.errors import MissingMandatoryValue, OmegaConfBaseException

from graspfn.params import FOLDERS, Key, ParameterError, Params, check_folders, section_type, validate

HEADER = """\
# Every parameter of the workflow. Edit a value here, or compose the file anew: `graspfn params GROUP=CHOICE KEY=VALUE`;
# the groups and their choices are the folders and files of conf/. `graspfn check` says whether all is well.
"""
# Text that DVC, which reads YAML 1.2, would take for a number where PyYAML, which writes 1.1, leaves out the quotes.
NUMBER_TO_DVC = re.compile(r"[-+]?\.?\d[\d_.]*(e[-+]?\d+)?|0o[0-7_]+", re.IGNORECASE)


def compose(overrides: list[str], conf: Path = Path("conf")) -> dict[str, Any]:
    """The content of params.yaml: the defaults of conf/config.yaml, then each GROUP=CHOICE and KEY=VALUE.

    Raises ParameterError, which names the group or key.
    """
    if not (conf / "config.yaml").is_file():
        raise ParameterError(f"{conf / 'config.yaml'}: no such file; run graspfn in the folder that holds conf")
    texts = {key: text for override in overrides for key, text in _text(override, conf)}
    checked = [_override(override, conf) for override in overrides if override.partition("=")[0] not in texts]
    try:
        with initialize_config_dir(config_dir=str(conf.resolve()), version_base=None):
            config = hydra_compose("config", overrides=checked)
        for key, text in texts.items():
            OmegaConf.update(config, key, text, force_add=True)
        values = OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
    except MissingMandatoryValue as error:
        raise ParameterError(f"{error.full_key}: missing; add {error.full_key}=VALUE") from None
    except OmegaConfBaseException as error:
        raise ParameterError(f"{error.full_key or ' '.join(overrides)}: {_first_line(error)}") from None
    except HydraException as error:
        wrong = getattr(error, "override", None) or " ".join(overrides)
        raise ParameterError(f"{wrong.lstrip('+')}: {_first_line(error)}") from None
    check_folders(validate(values), conf.parent)
    return typing.cast(dict[str, Any], values)


def _text(override: str, conf: Path) -> Iterator[tuple[str, str | None]]:
    """Key and value, where the key takes text: that is taken as it is typed, not in Hydra's grammar."""
    key, equals, value = override.partition("=")
    taken, rule = _hint(key)
    if not equals or (conf / key).is_dir():
        return
    if taken == str | None and value == "null":
        yield key, None
    elif taken in (str, str | None):
        value = os.path.expanduser(value) if key in FOLDERS else value
        rule.check(value, key)
        yield key, value


def _hint(key: str) -> tuple[Any, Key]:
    """The type and the rule of a key; of one that Params does not have, none that asks for anything."""
    hint: Any = Params
    for name in key.split("."):
        if typing.get_origin(hint) is dict:
            hint = typing.get_args(hint)[1]
        elif dataclasses.is_dataclass(hint):
            hint = typing.get_type_hints(hint, include_extras=True).get(name)
        else:
            hint = None
    return typing.get_args(hint)[:2] if typing.get_origin(hint) is Annotated else (hint, Key(""))


def _override(text: str, conf: Path) -> str:
    """One argument as Hydra takes it, a group's choices checked here so that the message is one line."""
    key, equals, value = text.partition("=")
    if not equals or not re.fullmatch(r"\w+(\.\w+)*", key):
        raise ParameterError(f"{text}: takes GROUP=CHOICE or KEY=VALUE")
    if not (conf / key).is_dir():
        return f"++{text}"  # added even where it is unknown: validate() then says what is known
    choices = sorted(path.stem for path in (conf / key).glob("*.yaml"))
    several = re.fullmatch(r"\[(.+)\]", value) if key == "network" else None  # the one group that takes a list
    for choice in several[1].split(",") if several else [value]:
        if choice.strip() not in choices:
            raise ParameterError(f"{key}: {choice!r} is not one of {', '.join(choices)}")
    return text


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0]


def render(values: dict[str, Any]) -> str:
    """params.yaml as text: the order, and a comment on every key, from graspfn.params."""
    return HEADER + "\n" + "\n".join(_mapping(Params, values)) + "\n"


def _mapping(cls: type, values: dict[str, Any], indent: str = "") -> Iterator[str]:
    """Lines for one dataclass, runs of plain keys with their comments aligned, sections set off by an empty line."""
    hints = typing.get_type_hints(cls, include_extras=True)
    for plain, run in itertools.groupby(hints, lambda name: typing.get_origin(hints[name]) is Annotated):
        names = list(run)
        if plain:
            if names[0] != next(iter(hints)):
                yield ""
            leaves = [_leaf(name, values[name]) for name in names]
            width = max(map(len, leaves))
            for name, leaf in zip(names, leaves, strict=True):
                yield f"{indent}{leaf:<{width}}  # {_comment(typing.get_args(hints[name])[1])}"
            continue
        for name in names:
            section = _section(hints[name], values[name])
            yield from ["", f"# {(section.__doc__ or '').splitlines()[0]}", f"{name}:"]
            if dataclasses.is_dataclass(hints[name]):
                yield from _mapping(section, values[name], "  ")
            else:
                for entry, inner in values[name].items():
                    yield f"  {entry}:"
                    yield from _mapping(section_type(section, inner), inner, "    ")


def _section(hint: Any, values: dict[str, Any]) -> type:
    """The dataclass of a section: what the values make of `hint`, or V of dict[str, V]."""
    return section_type(hint, values) if isinstance(hint, type) else typing.get_args(hint)[1]


def _leaf(name: str, value: Any) -> str:
    plain = not isinstance(value, str) or (value.isprintable() and not NUMBER_TO_DVC.fullmatch(value))
    text = yaml.safe_dump(
        value, default_flow_style=True, default_style=None if plain else '"', allow_unicode=plain, width=math.inf
    )
    text = text.removesuffix("...\n")  # a lone scalar's end mark
    return f"{name}: {text.strip()}"


def _comment(key: Key) -> str:
    *others, last = key.one_of or ("",)
    return f"{key.meaning}: {', '.join(others)} or {last}" if others else key.meaning
