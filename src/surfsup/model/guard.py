"""The guard: no particle stays inside the solid or outside the container, whatever the network says."""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.model.state import Surroundings
from surfsup.scene import SURFACE_CLEARANCE, WALL_CLEARANCE

ROUNDS = 4


def guard(positions: Tensor, velocities: Tensor, around: Surroundings) -> tuple[Tensor, Tensor, Tensor]:
    """Push particles out along the normal and take away the part of their velocity that points in.

    The clearances are the smallest distances that the reference solver leaves. A push that ends too close to
    something else is repeated, a few rounds at most; the last word is had by the container's walls.

    Returns:
        positions (N, 3), velocities (N, 3), and which particles (N,) were moved.
    """
    lower, upper = around.lower + WALL_CLEARANCE, around.upper - WALL_CLEARANCE
    moved = torch.zeros(len(positions), dtype=torch.bool, device=positions.device)
    for _ in range(ROUNDS):
        inside = torch.minimum(torch.maximum(positions, lower), upper)
        at_wall = inside != positions
        outward = torch.where(at_wall, inside - positions, 0.0)
        velocities = torch.where(at_wall & (velocities * outward < 0), 0.0, velocities)
        positions, moved = inside, moved | at_wall.any(dim=-1)
        if around.surface is None:
            break
        distance, normal = around.distance_and_normal(positions)
        too_deep = (SURFACE_CLEARANCE - distance).clamp(min=0)
        if not bool((too_deep > 1e-6).any()):
            break
        pushed = too_deep > 0
        inward = (velocities * normal).sum(dim=-1).clamp(max=0) * pushed
        positions = positions + too_deep[:, None] * normal
        velocities = velocities - inward[:, None] * normal
        moved = moved | pushed
    return positions, velocities, moved
