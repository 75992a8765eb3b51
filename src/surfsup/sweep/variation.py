"""A key of a scene and the values that it takes in a sweep."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from surfsup.errors import InputError

FORM = "key=first:last:count or key=value,value,..., such as gravity.2=-9.81:-1.6:4"
MAX_CASES = 100_000
Value = float | int | str


@dataclass(frozen=True)
class Variation:
    """A key of a scene file and its values.

    Attributes:
        key: the path to the value, its steps separated by dots; a number counts list entries from 0, as in
            ``fluid.0.block.velocity.2``.
        values: what it becomes, one after the other.
    """

    key: str
    values: tuple[Value, ...]

    @classmethod
    def parse(cls, text: str) -> Variation:
        """Read ``key=first:last:count`` or ``key=value,value,...``.

        Raises:
            InputError: the text has another form.
        """
        key, equals, given = text.partition("=")
        if not (equals and key.strip() and given.strip()):
            raise InputError(f"--vary {text}: is not {FORM}")
        return cls(key.strip(), evenly_spaced(text, given) if ":" in given else listed(text, given))


def evenly_spaced(text: str, given: str) -> tuple[Value, ...]:
    """The values of ``first:last:count``, both ends included."""
    try:
        first, last, count = (part.strip() for part in given.split(":"))
        number, ends = int(count), (float(first), float(last))
    except ValueError:
        raise InputError(f"--vary {text}: is not {FORM}") from None
    if not 1 <= number <= MAX_CASES or not all(map(math.isfinite, ends)):
        raise InputError(f"--vary {text}: needs finite ends and a count from 1 to {MAX_CASES}")
    return tuple(float(f"{value:.9g}") for value in np.linspace(*ends, number))


def listed(text: str, given: str) -> tuple[Value, ...]:
    """The values of ``value,value,...``: numbers where they are numbers, else words."""
    values = tuple(number_or_word(part.strip()) for part in given.split(","))
    if "" in values:
        raise InputError(f"--vary {text}: has an empty value")
    return values


def number_or_word(text: str) -> Value:
    """An integer, a float or the text itself."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


def replaced(description: Any, key: str, value: Value, scene: str) -> Any:
    """A copy of a scene's nested ``description`` with another value at ``key``.

    Args:
        description: mappings and lists, as read from a scene file with all defaults filled in.
        key: the path, its steps separated by dots.
        value: the new value.
        scene: the name of the scene, for messages.

    Raises:
        InputError: the path leads nowhere.
    """
    step, _, rest = key.partition(".")
    if isinstance(description, Mapping):
        if rest and step not in description:
            raise InputError(f"--vary {key}: {scene} has no '{step}' there, but {', '.join(map(str, description))}")
        return {
            **description,
            step: replaced(description[step], rest, value, scene) if rest else value,
        }
    if isinstance(description, Sequence) and not isinstance(description, str):
        if not step.isdecimal() or int(step) >= len(description):
            entries = f"the entries 0 to {len(description) - 1}" if description else "no entries"
            raise InputError(f"--vary {key}: {scene} has {entries} there, no '{step}'")
        entries_after = list(description)
        entries_after[int(step)] = replaced(entries_after[int(step)], rest, value, scene) if rest else value
        return entries_after
    raise InputError(f"--vary {key}: {scene} has the value {description} there, which has no parts")
