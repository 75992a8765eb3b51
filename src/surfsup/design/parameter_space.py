"""The parameters of a design as one vector, in units of their step lengths."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from surfsup.design.parameter import Parameter, Values, clamp_to_bounds


class ParameterSpace:
    """Converts between values by name and a vector (P,) whose elements are counted in step lengths.

    Attributes:
        parameters: by name.
        step_lengths: (P,), each in its parameter's own unit.
    """

    def __init__(self, parameters: Mapping[str, Parameter], start: Values) -> None:
        self.parameters = parameters
        self.shapes = {name: value.shape for name, value in start.items()}
        self.step_lengths = torch.cat(
            [torch.full((value.numel(),), parameters[name].step) for name, value in start.items()]
        )

    def to_vector(self, values: Values) -> Tensor:
        """The vector (P,) of these values."""
        return torch.cat([values[name].detach().flatten() for name in self.shapes]) / self.step_lengths

    def gradient_vector(self, gradients: Values) -> Tensor:
        """Gradients by name as a vector (P,), in reward per step length."""
        return torch.cat([gradients[name].detach().flatten() for name in self.shapes]) * self.step_lengths

    def to_values(self, vector: Tensor) -> dict[str, Tensor]:
        """The values of a vector (P,), clamped to their bounds."""
        numbers, values = vector * self.step_lengths, {}
        for name, shape in self.shapes.items():
            values[name] = numbers[: shape.numel()].reshape(shape)
            numbers = numbers[shape.numel() :]
        return clamp_to_bounds(self.parameters, values)

    def clamp(self, vector: Tensor) -> Tensor:
        """The vector (P,), clamped to the bounds."""
        return self.to_vector(self.to_values(vector))

    def frozen(self, values: Values) -> Tensor:
        """Which elements (P,) have reached the value at which they stay."""
        return torch.cat(
            [
                torch.full((value.numel(),), False)
                if (freeze_at := self.parameters[name].freeze_at) is None
                else (value == freeze_at).flatten()
                for name, value in values.items()
            ]
        )
