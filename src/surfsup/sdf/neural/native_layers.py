"""A network of a solid as the native code takes it."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

# What a layer multiplies the layer before by (W, W), None in the first; what it multiplies a place by, and the sines
# and cosines of its octaves (W, 3 + 6 octaves), in the first and where these come in again; its biases (W,); what it
# multiplies the code by (W, C).
NativeLayer = tuple[np.ndarray | None, np.ndarray | None, list[np.ndarray], np.ndarray | None]


class NativeLayers(TypedDict):
    """The arguments of :meth:`surfsup.native.Solid.of_network` that a network knows, in single precision.

    Attributes:
        layers: from the first to the last but one.
        last: (W,), what the last layer is multiplied by.
        last_bias: (1,).
        code: (C,) of the shape, where there are several.
        frequency: of sines; 0 stands for rectified linear units.
        octaves: of the sines and cosines of a place that come in beside it.
    """

    layers: list[NativeLayer]
    last: np.ndarray
    last_bias: np.ndarray
    code: np.ndarray | None
    frequency: float
    octaves: int
