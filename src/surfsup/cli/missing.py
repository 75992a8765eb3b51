"""All arguments and options that a command line lacks, in one line."""

from __future__ import annotations

from typing import Any

import typer

EXAMPLE = "Example: "


def missing_parameters(error: typer.TyperException) -> str | None:
    """What to say of an error about a missing parameter, with all that are missing and the verb's example.

    None for other errors.
    """
    context = getattr(error, "ctx", None)
    if type(error).__name__ != "MissingParameter" or context is None:
        return None
    # Those on the command line are parsed first, so what is not yet known is missing.
    lacking = [parameter for parameter in context.command.params if parameter.required]
    names = [name_of(parameter) for parameter in lacking if parameter.name not in context.params]
    *rest, last = names
    listed = f"{', '.join(rest)} and {last}" if rest else last
    lines = (line.strip() for line in (context.command.help or "").splitlines())
    example = next((line.removeprefix(EXAMPLE) for line in lines if line.startswith(EXAMPLE)), None)
    return f"{listed} {'are' if rest else 'is'} missing" + ("" if example is None else f", as in: {example}")


def name_of(parameter: Any) -> str:
    """An argument as help shows it, or the long name of an option."""
    longest: str = max(parameter.opts, key=len)
    return longest if longest.startswith("-") else parameter.get_error_hint().replace("'", "")
