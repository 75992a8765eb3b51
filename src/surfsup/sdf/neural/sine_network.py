"""A network of sine layers: value and gradient in one pass."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from surfsup.errors import InputError
from surfsup.sdf.neural.native_layers import NativeLayers

FIRST = 1.0  # the bound of the first layer's weights times its inputs


class SineNetwork(nn.Module):
    """A field F(x) of places x (N, 3): h <- sin(ω (W h + b)) some times over, then one linear layer.

    Source: Sitzmann et al., "Implicit Neural Representations with Periodic Activation Functions", 2020. The weights
    start as theirs do, U(-1/3, 1/3) in the first layer and U(-√(6/n)/ω, √(6/n)/ω) in those after it, so that the
    arguments of all sines are spread alike.

    Args:
        width: of every layer.
        layers: of ``width`` by ``width``, after the first.
        frequency: ω.

    Raises:
        InputError: one of them is not above zero.
    """

    def __init__(self, width: int = 128, layers: int = 3, frequency: float = 30.0) -> None:
        super().__init__()
        if not (width > 0 and layers > 0 and 0 < frequency < math.inf):
            raise InputError(f"a sine network of width {width}, {layers} layers and frequency {frequency} is none")
        self.width, self.layers, self.frequency = width, layers, frequency
        inputs = [3] + [width] * layers
        self.weights = nn.ParameterList()
        self.biases = nn.ParameterList()
        for number, size in enumerate(inputs):
            bound = FIRST / size if number == 0 else math.sqrt(6 / size) / frequency
            self.weights.append(nn.Parameter(torch.empty(width, size).uniform_(-bound, bound)))
            self.biases.append(nn.Parameter(torch.empty(width).uniform_(-1 / math.sqrt(size), 1 / math.sqrt(size))))
        bound = math.sqrt(6 / width) / frequency
        self.last = nn.Parameter(torch.empty(width).uniform_(-bound, bound))
        self.last_bias = nn.Parameter(torch.zeros(1))

    def native_layers(self) -> NativeLayers:
        """The layers for the native code."""
        first, *hidden = (weight.detach().numpy() for weight in self.weights)
        first_bias, *biases = (bias.detach().numpy() for bias in self.biases)
        layers = [(None, first, [first_bias], None)]
        layers += [(weight, None, [bias], None) for weight, bias in zip(hidden, biases, strict=True)]
        last, last_bias = self.last.detach().numpy(), self.last_bias.detach().numpy()
        frequency = self.frequency
        return {
            "layers": layers,
            "last": last,
            "last_bias": last_bias,
            "code": None,
            "frequency": frequency,
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

        The gradient goes back through the layers by the chain rule written out, so both are differentiable like any
        other expression, and training on ∇F needs no derivative of a derivative.
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
