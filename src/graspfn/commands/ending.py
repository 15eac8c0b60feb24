"""How commands end."""

from __future__ import annotations

from collections.abc import Iterable

import typer

BAD_INPUT = 2


def end_at(problems: Iterable[str], status: int) -> None:
    """Print problems, if there are any, and end with an exit status."""
    problems = list(problems)
    for problem in problems:
        typer.echo(problem, err=True)
    if problems:
        raise typer.Exit(status)
