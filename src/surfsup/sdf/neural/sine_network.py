"""A network of sine layers, with value and gradient in one pass."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from surfsup.errors import InputError
from surfsup.sdf.neural.native_layers import NativeLayer, NativeLayers

FIRST_BOUND = 1.0  # bound of the first layer's initial weights, times its number of inputs


class SineNetwork(nn.Module):
    """A field F(x) of points x (N, 3): h <- sin(ω (W h + b)) several times, then one linear layer.

    Source: Sitzmann et al., "Implicit Neural Representations with Periodic Activation Functions", 2020. Weights are
    initialized as published, U(-1/3, 1/3) in the first layer and U(-√(6/n)/ω, √(6/n)/ω) in the others, so that the
    arguments of all sines have the same distribution.

    Args:
        width: Channels of every layer.
        layers: Number of layers of ``width`` by ``width`` after the first.
        frequency: ω.

    Raises:
        InputError: One of them is not positive.
    """

    def __init__(self, width: int = 128, layers: int = 3, frequency: float = 30.0) -> None:
        super().__init__()
        if not (width > 0 and layers > 0 and 0 < frequency < math.inf):
            raise InputError(
                f"siren: width, layers and frequency must be positive, not {width}, {layers} and {frequency}"
            )
        self.width, self.layers, self.frequency = width, layers, frequency
        inputs = [3] + [width] * layers
        self.weights = nn.ParameterList()
        self.biases = nn.ParameterList()
        for number, size in enumerate(inputs):
            bound = FIRST_BOUND / size if number == 0 else math.sqrt(6 / size) / frequency
            self.weights.append(nn.Parameter(torch.empty(width, size).uniform_(-bound, bound)))
            self.biases.append(nn.Parameter(torch.empty(width).uniform_(-1 / math.sqrt(size), 1 / math.sqrt(size))))
        bound = math.sqrt(6 / width) / frequency
        self.last = nn.Parameter(torch.empty(width).uniform_(-bound, bound))
        self.last_bias = nn.Parameter(torch.zeros(1))

    def native_layers(self) -> NativeLayers:
        """The layers for the native code."""
        first, *hidden = (weight.detach().numpy() for weight in self.weights)
        first_bias, *biases = (bias.detach().numpy() for bias in self.biases)
        layers: list[NativeLayer] = [(None, first, [first_bias], None)]
        layers += [(weight, None, [bias], None) for weight, bias in zip(hidden, biases, strict=True)]
        return {
            "layers": layers,
            "last": self.last.detach().numpy(),
            "last_bias": self.last_bias.detach().numpy(),
            "code": None,
            "frequency": self.frequency,
            "octaves": 0,
        }

    def value(self, points: Tensor) -> Tensor:
        """F (N,) at ``points`` (N, 3)."""
        hidden = points
        for weight, bias in zip(self.weights, self.biases, strict=True):
            hidden = torch.sin(torch.addmm(self.frequency * bias, hidden, (self.frequency * weight).T))
        return hidden @ self.last + self.last_bias

    def value_and_gradient(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """F (N,) at ``points`` (N, 3) and ∇F (N, 3).

        The gradient is the chain rule written out. Hence both results are differentiable like any other expression,
        and training on ∇F needs no double backward pass.
        """
        hidden, slopes = points, []
        scaled = [self.frequency * weight for weight in self.weights]
        for weight, bias in zip(scaled, self.biases, strict=True):
            argument = torch.addmm(self.frequency * bias, hidden, weight.T)
            hidden = torch.sin(argument)
            slopes.append(torch.cos(argument))
        first, *hidden_weights = scaled
        gradient = self.last
        for weight, slope in zip(reversed(hidden_weights), reversed(slopes[1:]), strict=True):
            gradient = (gradient * slope) @ weight
        gradient = (gradient * slopes[0]) @ first
        return hidden @ self.last + self.last_bias, gradient
