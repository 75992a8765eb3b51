"""Options that several verbs share: a dataclass in Python, single options on the command line."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import is_dataclass
from typing import Any


def expand_option_groups(verb: Callable[..., None]) -> Callable[..., None]:
    """Let a verb take dataclasses of options.

    Each field of a parameter whose type is a dataclass becomes a parameter of the returned command, with the annotation
    and default of the field. The command collects their values into the dataclass again and calls the verb.
    """
    groups: dict[str, Callable[..., Any]] = {}
    expanded: list[inspect.Parameter] = []
    for parameter in inspect.signature(verb, eval_str=True).parameters.values():
        group = parameter.annotation
        if isinstance(group, type) and is_dataclass(group):
            groups[parameter.name] = group
            expanded += inspect.signature(group, eval_str=True).parameters.values()
        else:
            expanded.append(parameter)

    @functools.wraps(verb)
    def command(**values: Any) -> None:
        for name, group in groups.items():
            values[name] = group(**{field: values.pop(field) for field in inspect.signature(group).parameters})
        verb(**values)

    keywords = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in expanded]
    command.__signature__ = inspect.Signature(keywords)  # type: ignore[attr-defined]  # typer reads it
    return command
