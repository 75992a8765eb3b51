"""A validation error as one line that names the key and how to mend it."""

from __future__ import annotations

import difflib
from typing import get_args

from pydantic import BaseModel, ValidationError


def one_line(error: ValidationError, model: type[BaseModel]) -> str:
    """The first complaint of ``error`` about a ``model``, with the nearest valid key for an unknown one."""
    first = error.errors()[0]
    place = [part for part in first["loc"]]
    where = ".".join(str(part) for part in place)
    if first["type"] == "extra_forbidden":
        known = keys_at(model, place[:-1])
        near = difflib.get_close_matches(str(place[-1]), known, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"known are {', '.join(known)}"
        return f"unknown key '{where}'; {hint}"
    message = first["msg"].removeprefix("Value error, ")
    given = first["input"]
    shown = "" if isinstance(given, dict | list | BaseModel) else f" (found {given!r})"
    return f"{where or 'scene'}: {message}{shown}"


def keys_at(model: type[BaseModel], place: list[str | int]) -> list[str]:
    """The keys that are valid at ``place`` inside ``model``."""
    for part in place:
        if isinstance(part, int):
            continue
        model = nested_model(model.model_fields[part].annotation)
    return list(model.model_fields)


def nested_model(annotation: object) -> type[BaseModel]:
    """The model inside an annotation such as ``list[Model] | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in get_args(annotation):
        found = nested_model(argument) if argument is not type(None) else None
        if found is not None:
            return found
    return None
