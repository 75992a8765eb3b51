"""The values of a design as one vector, each number counted in steps of its parameter."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from surfsup.design.parameter import Parameter, Values, within


class Coordinates:
    """To and fro between values by name and a vector (P,).

    Attributes:
        parameters: what may change, by name.
        steps: (P,) the step of each number, in its own units.
    """

    def __init__(self, parameters: Mapping[str, Parameter], start: Values) -> None:
        self.parameters = parameters
        self.shapes = {name: value.shape for name, value in start.items()}
        self.steps = torch.cat([torch.full((value.numel(),), parameters[name].step) for name, value in start.items()])

    def place(self, values: Values) -> Tensor:
        """The vector (P,) of these values."""
        return torch.cat([values[name].detach().flatten() for name in self.shapes]) / self.steps

    def slope(self, gradients: Values) -> Tensor:
        """Gradients in the values as one (P,) in reward a step."""
        return torch.cat([gradients[name].detach().flatten() for name in self.shapes]) * self.steps

    def values(self, place: Tensor) -> dict[str, Tensor]:
        """The values at a place (P,), each moved to the nearest in its range."""
        numbers, found = place * self.steps, {}
        for name, shape in self.shapes.items():
            found[name] = numbers[: shape.numel()].reshape(shape)
            numbers = numbers[shape.numel() :]
        return within(self.parameters, found)

    def inside(self, place: Tensor) -> Tensor:
        """The nearest place (P,) that the ranges allow."""
        return self.place(self.values(place))

    def keeping(self, values: Values) -> Tensor:
        """Which numbers (P,) have reached a value that they keep."""
        return torch.cat(
            [
                torch.full((value.numel(),), False)
                if (kept := self.parameters[name].keeps) is None
                else (value == kept).flatten()
                for name, value in values.items()
            ]
        )
