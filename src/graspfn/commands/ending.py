"""How commands end."""

from __future__ import annotations

from collections.abc import Iterable

import typer

BAD_INPUT, NO_GRASP = 2, 3
LACKS_WORKFLOW = "not installed; it takes graspfn[workflow], and that Python 3.11"  # of a module


class InputError(ValueError):
    """What was given cannot be used: one line that names the file and the option, and says what they take."""


def end_at(problems: Iterable[str], status: int) -> None:
    """Print problems, if there are any, and end with an exit status."""
    problems = list(problems)
    for problem in problems:
        typer.echo(problem, err=True)
    if problems:
        raise typer.Exit(status)
