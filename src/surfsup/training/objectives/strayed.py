"""How much is asked of a state that has strayed from the truth in the frames before.

Where a rollout has strayed far, in a splash, the truth of a particle says nothing of the one that stands in its
place, and would drown what can be learned. So there no more is asked than where it has strayed by these bounds, and the
answer counts for less.
"""

from __future__ import annotations

import torch
from torch import Tensor

FARTHEST = 1.5e-3  # meters strayed, beyond which no more is asked
FASTEST = 0.3  # m/s that a velocity is off, likewise
UNSURE = 5e-3  # meters strayed at which an error counts half


def at_most(vectors: Tensor, length: float) -> Tensor:
    """``vectors`` (N, 3), longer ones shortened to ``length``."""
    return vectors * (length / torch.linalg.vector_norm(vectors, dim=-1, keepdim=True).clamp(min=length))


def weight_of(strayed: Tensor) -> Tensor:
    """What the error of a particle counts (N,) that has ``strayed`` by so much (N, 3), in meters: 1 on the truth."""
    return 1 / (1 + strayed.square().sum(dim=-1) / UNSURE**2)
