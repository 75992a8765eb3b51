"""A network of places and a latent code: value and gradient in one pass."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from surfsup.errors import InputError
from surfsup.sdf.neural.native_layers import NativeLayers


@dataclass(frozen=True)
class CodeSizes:
    """What the network is made of.

    Attributes:
        width: of every layer.
        layers: how many of them.
        code: numbers in a latent code.
        octaves: of the sines and cosines of a place that it is told beside the place itself.
    """

    width: int = 128
    layers: int = 5
    code: int = 32
    octaves: int = 3


class CodeNetwork(nn.Module):
    """A field F(x, z) of places x and a code z, by layers of rectified linear units.

    Place and code come in twice, at the first layer and again in the middle, as in DeepSDF (Park et al., 2019). Of
    ours: sin(π 2ᵏ x) and cos(π 2ᵏ x) beside x, with which a much smaller network tells slats from gaps.

    Raises:
        InputError: a size is not above zero.
    """

    def __init__(self, sizes: CodeSizes) -> None:
        super().__init__()
        if not (sizes.width > 0 and sizes.layers > 1 and sizes.code > 0 and sizes.octaves >= 0):
            raise InputError(f"a network of {sizes} is none")
        self.sizes = sizes
        self.entries = (0, sizes.layers // 2)
        inputs = 3 + 6 * sizes.octaves
        self.of_place = nn.ModuleList([nn.Linear(inputs, sizes.width) for _ in self.entries])
        self.of_code = nn.ModuleList([nn.Linear(sizes.code, sizes.width, bias=False) for _ in self.entries])
        self.hidden = nn.ModuleList([nn.Linear(sizes.width, sizes.width) for _ in range(sizes.layers - 1)])
        self.last = nn.Linear(sizes.width, 1)
        for layer in self.hidden:
            nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
            nn.init.zeros_(layer.bias)

    def native_layers(self, code: Tensor) -> NativeLayers:
        """The layers and the ``code`` (C,) of a shape, for the native code."""
        layers: list[list[object]] = [[None, None, [], None] for _ in range(self.sizes.layers)]
        for layer, linear in zip(layers[1:], self.hidden, strict=True):
            layer[0] = linear.weight.detach().numpy()
            layer[2] = [linear.bias.detach().numpy()]
        for number, of_place, of_code in zip(self.entries, self.of_place, self.of_code, strict=True):
            layers[number][1] = of_place.weight.detach().numpy()
            layers[number][2] += [of_place.bias.detach().numpy()]
            layers[number][3] = of_code.weight.detach().numpy()
        return {
            "layers": [tuple(layer) for layer in layers],
            "last": self.last.weight.detach().numpy()[0],
            "last_bias": self.last.bias.detach().numpy(),
            "code": code.detach().contiguous().numpy(),
            "frequency": 0.0,
            "octaves": self.sizes.octaves,
        }

    def value(self, points: Tensor, codes: Tensor) -> Tensor:
        """F (S, N) at ``points`` (S, N, 3) of S shapes of ``codes`` (S, C)."""
        seen = self.features(points)
        hidden = self.entering(0, seen, codes).relu()
        for number, layer in enumerate(self.hidden, 1):
            argument = layer(hidden)
            if number == self.entries[1]:
                argument = argument + self.entering(1, seen, codes)
            hidden = argument.relu()
        return self.last(hidden).squeeze(-1)

    def value_and_gradient(self, points: Tensor, code: Tensor) -> tuple[Tensor, Tensor]:
        """F (N,) at ``points`` (N, 3) of the shape of ``code`` (C,), and ∇F (N, 3) in the places.

        Both are differentiable in places, code and weights, but for the kinks of the layers.
        """
        seen = self.features(points)
        hidden = self.entering(0, seen, code).relu()
        active = [hidden > 0]
        for number, layer in enumerate(self.hidden, 1):
            argument = layer(hidden)
            if number == self.entries[1]:
                argument = argument + self.entering(1, seen, code)
            hidden = argument.relu()
            active.append(hidden > 0)
        value = self.last(hidden).squeeze(-1)
        gradient = self.last.weight * active[-1]
        into_features = torch.zeros_like(seen)
        for number in range(len(self.hidden), 0, -1):
            if number == self.entries[1]:
                into_features = into_features + gradient @ self.of_place[1].weight
            gradient = (gradient @ self.hidden[number - 1].weight) * active[number - 1]
        into_features = into_features + gradient @ self.of_place[0].weight
        return value, self.through_features(points, into_features)

    def entering(self, entry: int, seen: Tensor, codes: Tensor) -> Tensor:
        """What place and code add to the layer at ``entry``; a code counts for all places of its shape."""
        of_code = self.of_code[entry](codes)
        return self.of_place[entry](seen) + (of_code if codes.dim() == 1 else of_code[:, None])

    def features(self, points: Tensor) -> Tensor:
        """What the network is told of places (..., 3): (..., 3 + 6 · octaves)."""
        parts = [points]
        for octave in range(self.sizes.octaves):
            turned = math.pi * 2**octave * points
            parts += [turned.sin(), turned.cos()]
        return torch.cat(parts, dim=-1)

    def through_features(self, points: Tensor, gradient: Tensor) -> Tensor:
        """The gradient (N, 3) in the places from that in their features."""
        own, *pairs = gradient.split(3, dim=-1)
        for octave in range(self.sizes.octaves):
            pace = math.pi * 2**octave
            of_sine, of_cosine = pairs[2 * octave], pairs[2 * octave + 1]
            own = own + pace * (of_sine * (pace * points).cos() - of_cosine * (pace * points).sin())
        return own
