"""A validation error as one line that names the key and how to mend it."""

from __future__ import annotations

import difflib
from typing import get_args

from pydantic import BaseModel, ValidationError

LONGEST_VALUE = 60  # characters of a wrong value that are shown


def one_line(error: ValidationError, model: type[BaseModel]) -> str:
    """The first complaint of ``error`` about a ``model``, with the nearest valid key for an unknown one.

    A misspelt key comes first: what else is wrong, such as the missing right key, mostly follows from it.
    """
    complaints = error.errors()
    first = next((one for one in complaints if one["type"] == "extra_forbidden"), complaints[0])
    place = list(first["loc"])
    where = " ".join(".".join(str(part) for part in place).split())
    if first["type"] == "extra_forbidden":
        known = keys_at(model, place[:-1])
        near = difflib.get_close_matches(str(place[-1]), known, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"known are {', '.join(known)}"
        return f"unknown key '{where}'; {hint}"
    message = first["msg"].removeprefix("Value error, ")
    if first["type"] == "model_type":
        message = f"must be a mapping with keys out of {', '.join(keys_at(model, place))}"
    given = first["input"]
    shown = "" if isinstance(given, dict | list | BaseModel) else f" (found {shortened(given)})"
    return f"{where or 'it'}: {message}{shown}"


def shortened(value: object) -> str:
    """``value`` as Python writes it, cut where it is long."""
    text = repr(value)
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 3] + "..."


def keys_at(model: type[BaseModel], place: list[str | int]) -> list[str]:
    """The keys that are valid at ``place`` inside ``model``."""
    for part in place:
        if isinstance(part, int):
            continue
        model = nested_model(model.model_fields[part].annotation)
    return list(model.model_fields)


def nested_model(annotation: object) -> type[BaseModel] | None:
    """The model inside an annotation such as ``list[Model] | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for part in get_args(annotation) if (found := nested_model(part)) is not None), None)
