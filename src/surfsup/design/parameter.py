"""Design parameters: numbers with bounds and a step length."""

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
    """A number or an array that shapes a surface.

    Attributes:
        start: initial value.
        lower, upper: bounds, one number for all elements or one for each. A bound may also be a function of the values
            of the parameters listed before this one.
        step: step length of the first iterations, in the parameter's own unit; later steps are shorter.
        freeze_at: a value at which the parameter stays once it has reached it, such as 0 for a hole that has closed.
        freeze_tolerance: how near to ``freeze_at`` counts as reached, in the parameter's own unit.
        unit: its symbol on plots, such as m; empty for a number without a unit.
    """

    start: Numbers
    lower: Bound
    upper: Bound
    step: float
    freeze_at: float | None = None
    freeze_tolerance: float = 0.0
    unit: str = ""


def start_values(parameters: Mapping[str, Parameter]) -> dict[str, Tensor]:
    """The initial value of every parameter.

    Raises:
        InputError: one is not finite or out of bounds; the message gives the bounds.
    """
    values: dict[str, Tensor] = {}
    for name, parameter in parameters.items():
        value = torch.as_tensor(parameter.start, dtype=torch.float32).clone()
        low, high = bounds(parameter, values)
        if not bool(torch.isfinite(value).all() and (value >= low).all() and (value <= high).all()):
            raise InputError(
                f"the start of {name} is {format_range(value)}, outside its bounds: {format_range(low, high)}"
            )
        values[name] = value
    return values


def format_range(*tensors: Tensor) -> str:
    """The smallest and the largest number in the tensors, in words."""
    numbers = torch.cat([tensor.flatten() for tensor in tensors])
    low, high = float(numbers.min()), float(numbers.max())
    return f"{low:.4g}" if numbers.numel() == 1 else f"{low:.4g} to {high:.4g}"


def clamp_to_bounds(parameters: Mapping[str, Parameter], values: Values) -> dict[str, Tensor]:
    """The values, each clamped to its bounds."""
    clamped: dict[str, Tensor] = {}
    for name, parameter in parameters.items():
        low, high = bounds(parameter, clamped)
        clamped[name] = torch.minimum(torch.maximum(values[name], low), high)
    return clamped


def bounds(parameter: Parameter, previous: Values) -> tuple[Tensor, Tensor]:
    """The bounds of a parameter for these values of the ``previous`` ones, as tensors of its shape or scalars."""
    low, high = (
        torch.as_tensor(bound(previous) if callable(bound) else bound, dtype=torch.float32)
        for bound in (parameter.lower, parameter.upper)
    )
    return low, high
