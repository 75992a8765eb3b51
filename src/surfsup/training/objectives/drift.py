"""Bounds of the target for a state that has drifted from the reference in earlier frames of push-forward.

In a splash a rollout drifts far. There the reference is no guide for the particle, and such errors would dominate the
loss. So the target corrects the drift by at most these bounds, and errors of drifted particles have less weight.
"""

from __future__ import annotations

import torch
from torch import Tensor

MAX_POSITION_DRIFT = 1.5e-3  # meters
MAX_VELOCITY_DRIFT = 0.3  # m/s
HALF_WEIGHT_DRIFT = 5e-3  # meters; an error of a particle that has drifted this far has half the weight


def clamp_length(vectors: Tensor, length: float) -> Tensor:
    """``vectors`` (N, 3), scaled down where they are longer than ``length``."""
    return vectors * (length / torch.linalg.vector_norm(vectors, dim=-1, keepdim=True).clamp(min=length))


def drift_weight(drift: Tensor) -> Tensor:
    """The weight (N,) of the error of particles that have drifted by ``drift`` (N, 3) meters: 1 without drift."""
    return 1 / (1 + drift.square().sum(dim=-1) / HALF_WEIGHT_DRIFT**2)
