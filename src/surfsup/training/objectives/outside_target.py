"""Targets outside the solid and within the walls, for rollouts in training without collision handling.

The true displacement of a particle that has drifted may lead it into the solid. That of a particle that is inside leads
along the surface, and so would keep it there.
"""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.sph.collision import CLEARANCE
from surfsup.sph.environment import Environment


@torch.no_grad()
def outside_target(positions: Tensor, target: Tensor, step: float, environment: Environment) -> Tensor:
    """The ``target`` positions (N, 3) of a frame, moved to the clearance of collision handling where they are nearer.

    A particle whose clearance is smaller already moves out by only ``step`` meters in a frame, so that it does not
    gain much speed.

    Args:
        positions: (N, 3) at the start of the frame, meters.
        target: (N, 3), meters.
        step: meters.
        environment: container and solid.
    """
    lower, upper = environment.lower + CLEARANCE, environment.upper - CLEARANCE
    target = torch.maximum(target, torch.minimum(lower, positions + step))
    target = torch.minimum(target, torch.maximum(upper, positions - step))
    if environment.surface is None:
        return target
    distance, normal = environment.distance_and_normal(target)
    near = (distance < CLEARANCE).nonzero()[:, 0]
    if not len(near):
        return target
    least = (environment.distance_and_normal(positions[near])[0] + step).clamp(max=CLEARANCE)
    return target.index_add(0, near, (least - distance[near]).clamp(min=0)[:, None] * normal[near])
