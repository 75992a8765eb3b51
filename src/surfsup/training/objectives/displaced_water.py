"""Training states with water inside the solid or beyond a wall, from which a network learns the way out.

The reference never shows such states, and rollouts in training only as long as the network is bad at avoiding them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from surfsup.learned.message_passing.history import History
from surfsup.sph.environment import Environment

REACH = 0.06  # meters; particles no further from the solid or a wall can be displaced
MAX_PATCH_RADIUS = 0.15  # meters
MAX_DEPTH = 0.06  # meters


def displace_water(state: History, environment: Environment, random: np.random.Generator) -> History:
    """The state with a patch of water near the solid or a wall displaced into it; unchanged without such water."""
    inward, close = nearest_boundary(state.positions, environment)
    candidates = close.nonzero()[:, 0]
    if not len(candidates):
        return state
    center = state.positions[candidates[int(random.integers(len(candidates)))]]
    distance = torch.linalg.vector_norm(state.positions - center, dim=-1)
    chosen = close & (distance <= random.uniform(0, MAX_PATCH_RADIUS))
    depth = random.uniform(0, MAX_DEPTH)
    return replace(state, positions=state.positions + depth * inward * chosen[:, None])


def nearest_boundary(positions: Tensor, environment: Environment) -> tuple[Tensor, Tensor]:
    """The direction (N, 3) to the nearest point of solid and walls, and whether (N,) it is within REACH."""
    to_walls = torch.cat([positions - environment.lower, environment.upper - positions], dim=-1)
    to_wall, wall = to_walls.min(dim=-1)
    outward = torch.cat([-torch.eye(3), torch.eye(3)]).to(positions)[wall]
    to_solid, normal = environment.distance_and_normal(positions)
    inward = torch.where((to_solid < to_wall)[:, None], -normal, outward)
    return inward, torch.minimum(to_solid, to_wall) < REACH
