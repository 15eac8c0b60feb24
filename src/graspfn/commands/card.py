"""The card of a model: what a newcomer has to know before a robot moves."""

from __future__ import annotations

from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined


def card(config: dict[str, Any]) -> str:
    """README.md of a model's folder, from its config.json."""
    environment = Environment(
        loader=PackageLoader("graspfn", "commands"),
        undefined=StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # Markdown
        finalize=lambda value: f"{value:g}" if isinstance(value, float) else value,
    )
    return environment.get_template("card.md.j2").render(config=config)
