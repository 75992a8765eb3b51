"""The decoder of DeepSDF: a network of position and latent code, with value and gradient in one pass."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import torch
from torch import Tensor, nn

from surfsup.errors import InputError
from surfsup.sdf.neural.native_layers import NativeLayer, NativeLayers


@dataclass(frozen=True)
class DecoderSizes:
    """The architecture of a :class:`DeepSdfDecoder`.

    Attributes:
        width: Channels of every layer.
        layers: Number of layers.
        code: Length of a latent code.
        octaves: Octaves of the sines and cosines of a position that are inputs beside the position itself.
    """

    width: int = 128
    layers: int = 5
    code: int = 32
    octaves: int = 3


class DeepSdfDecoder(nn.Module):
    """A field F(x, z) of positions x and a latent code z, by layers of rectified linear units.

    Position and code are inputs of the first layer and again of the middle one, as in DeepSDF (Park et al., 2019). We
    add the inputs sin(π 2ᵏ x) and cos(π 2ᵏ x), with which a much smaller network resolves slats and gaps.

    Raises:
        InputError: A size is not positive.
    """

    def __init__(self, sizes: DecoderSizes) -> None:
        super().__init__()
        if not (sizes.width > 0 and sizes.layers > 1 and sizes.code > 0 and sizes.octaves >= 0):
            raise InputError(f"deepsdf: the sizes of a network must be positive and its layers at least 2, not {sizes}")
        self.sizes = sizes
        self.input_layers = (0, sizes.layers // 2)
        features = 3 + 6 * sizes.octaves
        self.from_position = layer_list(nn.Linear(features, sizes.width) for _ in self.input_layers)
        self.from_code = layer_list(nn.Linear(sizes.code, sizes.width, bias=False) for _ in self.input_layers)
        self.hidden = layer_list(nn.Linear(sizes.width, sizes.width) for _ in range(sizes.layers - 1))
        self.last = nn.Linear(sizes.width, 1)
        for layer in self.hidden:
            nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
            nn.init.zeros_(layer.bias)

    def native_layers(self, code: Tensor) -> NativeLayers:
        """The layers and the ``code`` (C,) of a shape, for the native code."""
        layers: list[NativeLayer] = []
        for number in range(self.sizes.layers):
            hidden = position = from_code = None
            biases = []
            if number > 0:
                hidden = array(self.hidden[number - 1].weight)
                biases.append(array(self.hidden[number - 1].bias))
            if number in self.input_layers:
                entry = self.input_layers.index(number)
                position, from_code = array(self.from_position[entry].weight), array(self.from_code[entry].weight)
                biases.append(array(self.from_position[entry].bias))
            layers.append((hidden, position, biases, from_code))
        return {
            "layers": layers,
            "last": array(self.last.weight)[0],
            "last_bias": array(self.last.bias),
            "code": array(code.contiguous()),
            "frequency": 0.0,
            "octaves": self.sizes.octaves,
        }

    def value(self, points: Tensor, codes: Tensor) -> Tensor:
        """F (S, N) at ``points`` (S, N, 3) of S shapes with ``codes`` (S, C)."""
        features = self.features(points)
        hidden = self.inputs(0, features, codes).relu()
        for number, layer in enumerate(self.hidden, 1):
            argument = layer(hidden)
            if number == self.input_layers[1]:
                argument = argument + self.inputs(1, features, codes)
            hidden = argument.relu()
        return self.last(hidden).squeeze(-1)

    def value_and_gradient(self, points: Tensor, code: Tensor) -> tuple[Tensor, Tensor]:
        """F (N,) at ``points`` (N, 3) of the shape with ``code`` (C,), and ∇F (N, 3) in the points.

        Both are differentiable in points, code and weights, except at the kinks of the layers.
        """
        features = self.features(points)
        hidden = self.inputs(0, features, code).relu()
        active = [hidden > 0]
        for number, layer in enumerate(self.hidden, 1):
            argument = layer(hidden)
            if number == self.input_layers[1]:
                argument = argument + self.inputs(1, features, code)
            hidden = argument.relu()
            active.append(hidden > 0)
        value = self.last(hidden).squeeze(-1)
        gradient = self.last.weight * active[-1]
        features_gradient = torch.zeros_like(features)
        for number in range(len(self.hidden), 0, -1):
            if number == self.input_layers[1]:
                features_gradient = features_gradient + gradient @ self.from_position[1].weight
            gradient = (gradient @ self.hidden[number - 1].weight) * active[number - 1]
        features_gradient = features_gradient + gradient @ self.from_position[0].weight
        return value, self.through_features(points, features_gradient)

    def inputs(self, entry: int, features: Tensor, codes: Tensor) -> Tensor:
        """What position and code add to input layer ``entry``; a code applies to all points of its shape."""
        from_code = self.from_code[entry](codes)
        return self.from_position[entry](features) + (from_code if codes.dim() == 1 else from_code[:, None])

    def features(self, points: Tensor) -> Tensor:
        """The inputs (..., 3 + 6 · octaves) of ``points`` (..., 3): positions, sines and cosines."""
        parts = [points]
        for octave in range(self.sizes.octaves):
            phase = math.pi * 2**octave * points
            parts += [phase.sin(), phase.cos()]
        return torch.cat(parts, dim=-1)

    def through_features(self, points: Tensor, features_gradient: Tensor) -> Tensor:
        """The gradient (N, 3) in the points from that in their features."""
        gradient, *pairs = features_gradient.split(3, dim=-1)
        for octave in range(self.sizes.octaves):
            frequency = math.pi * 2**octave
            sine_gradient, cosine_gradient = pairs[2 * octave], pairs[2 * octave + 1]
            gradient = gradient + frequency * (
                sine_gradient * (frequency * points).cos() - cosine_gradient * (frequency * points).sin()
            )
        return gradient


def layer_list(layers: Iterable[nn.Linear]) -> Sequence[nn.Linear]:
    """``layers`` as a module list, which torch does not type by its elements."""
    return cast(Sequence[nn.Linear], nn.ModuleList(layers))


def array(tensor: Tensor) -> np.ndarray:
    """The memory of ``tensor`` as a NumPy array."""
    return tensor.detach().numpy()
