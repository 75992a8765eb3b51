"""A validation error as one line that names the key and the remedy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

from pydantic import BaseModel, ValidationError

from surfsup.scene.scene_file import unknown_key

A_LIST = "must be a list: '- ' before each entry, or entries in brackets, separated by commas"
PLAIN_MESSAGES = {
    "missing": "is missing",
    "list_type": A_LIST,
    "tuple_type": A_LIST,
    "int_parsing": "must be a whole number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "float_parsing": "must be a number, without a unit (lengths are in meters)",
    "float_type": "must be a number",
}
MAX_VALUE_LENGTH = 60  # characters of an invalid value that the message shows


def format_validation_error(error: ValidationError, model: type[BaseModel]) -> str:
    """Format the first error of validating ``model`` as one line, with the closest valid key for an unknown one.

    An unknown key takes precedence: a misspelled key usually causes the other errors, such as the missing correct key.
    """
    errors = error.errors()
    first = next((entry for entry in errors if entry["type"] == "extra_forbidden"), errors[0])
    location = first["loc"]
    where = " ".join(".".join(map(str, location)).split())
    if first["type"] == "extra_forbidden":
        return unknown_key(where, str(location[-1]), valid_keys(model, location[:-1]))
    message = first["msg"].removeprefix("Value error, ")
    if first["type"] == "model_type":
        message = f"must be a mapping with keys out of {', '.join(valid_keys(model, location))}"
    message = PLAIN_MESSAGES.get(first["type"], message)
    value = first["input"]
    found = "" if isinstance(value, dict | list | BaseModel) else f" (found {abbreviate(value)})"
    return f"{where}: {message}{found}" if where else f"{message}{found}"


def abbreviate(value: object) -> str:
    """The ``repr`` of a value, truncated to MAX_VALUE_LENGTH."""
    text = repr(value)
    return text if len(text) <= MAX_VALUE_LENGTH else text[: MAX_VALUE_LENGTH - 3] + "..."


def valid_keys(model: type[BaseModel], location: Sequence[str | int]) -> list[str]:
    """The keys that are valid at ``location`` inside ``model``."""
    for number, key in enumerate(location):
        if isinstance(key, str) and key not in model.model_fields:
            if number and location[number - 1] == "surfaces":  # a name that the file gives
                continue
            return []  # the alias of a value
        nested = nested_model(model.model_fields[key].annotation) if isinstance(key, str) else model
        if nested is None:
            return []
        model = nested
    return [field.alias or name for name, field in model.model_fields.items()]


def nested_model(annotation: object) -> type[BaseModel] | None:
    """The model inside an annotation such as ``list[Model] | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for part in get_args(annotation) if (found := nested_model(part)) is not None), None)
