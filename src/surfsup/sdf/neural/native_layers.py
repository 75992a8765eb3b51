"""The layers of a neural surface as the native code takes them."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

# The weights of the previous layer's activations (W, W), None in the first layer; of the position and the sines and
# cosines of its octaves (W, 3 + 6 octaves), None in layers without that input; biases (W,); of the code (W, C) or None.
NativeLayer = tuple[np.ndarray | None, np.ndarray | None, list[np.ndarray], np.ndarray | None]


class NativeLayers(TypedDict):
    """Those arguments of :meth:`surfsup.native.Solid.of_network` that a network knows, in single precision.

    Attributes:
        layers: All but the last.
        last: (W,) weights of the last layer, whose output is the value.
        last_bias: (1,).
        code: (C,) latent code of the shape; None for networks of one shape.
        frequency: Frequency of the sine activations; 0 for rectified linear units.
        octaves: Octaves of the sines and cosines of a position that are inputs beside the position itself.
    """

    layers: list[NativeLayer]
    last: np.ndarray
    last_bias: np.ndarray
    code: np.ndarray | None
    frequency: float
    octaves: int
