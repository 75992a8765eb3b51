"""What a design may change: numbers with a range, and how far one iteration moves them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from surfsup.errors import InputError

Values = Mapping[str, Tensor]
Numbers = float | Sequence[float] | Sequence[Sequence[float]] | Tensor
Bound = Numbers | Callable[[Values], Tensor]


@dataclass(frozen=True)
class Parameter:
    """One number or array that shapes a surface.

    Attributes:
        start: where the design begins.
        lower, upper: its range: one number for all, or one for each; a bound may also be told by the values of the
            parameters listed before it.
        step: about how far the first iterations move it, in its own units; the last ones move it less.
        keeps: a value that it keeps once it has reached it, such as the 0 of a hole that has closed.
        reach: how near to that value counts as reached, in its own units.
    """

    start: Numbers
    lower: Bound
    upper: Bound
    step: float
    keeps: float | None = None
    reach: float = 0.0


def starts(parameters: Mapping[str, Parameter]) -> dict[str, Tensor]:
    """The start of every parameter.

    Raises:
        InputError: one is not a finite number, or outside its range; says which range is possible.
    """
    found: dict[str, Tensor] = {}
    for name, parameter in parameters.items():
        value = torch.as_tensor(parameter.start, dtype=torch.float32).clone()
        low, high = bounds(parameter, found)
        if not bool(torch.isfinite(value).all() and (value >= low).all() and (value <= high).all()):
            raise InputError(f"the start of {name} is {span(value)}, outside what is possible here: {span(low, high)}")
        found[name] = value
    return found


def span(*values: Tensor) -> str:
    """The numbers as one range in words."""
    numbers = torch.cat([value.flatten() for value in values])
    low, high = float(numbers.min()), float(numbers.max())
    return f"{low:.4g}" if numbers.numel() == 1 else f"{low:.4g} to {high:.4g}"


def within(parameters: Mapping[str, Parameter], values: Values) -> dict[str, Tensor]:
    """The values, each moved to the nearest in its range."""
    found: dict[str, Tensor] = {}
    for name, parameter in parameters.items():
        low, high = bounds(parameter, found)
        found[name] = torch.minimum(torch.maximum(values[name], low), high)
    return found


def bounds(parameter: Parameter, before: Values) -> tuple[Tensor, Tensor]:
    """The range of a parameter where those ``before`` it have these values, as tensors of its shape or of none."""
    low, high = (
        torch.as_tensor(bound(before) if callable(bound) else bound, dtype=torch.float32)
        for bound in (parameter.lower, parameter.upper)
    )
    return low, high
