"""What an objective asks of how near a predicted frame comes to the solid and the walls."""

from __future__ import annotations

from torch import Tensor

from surfsup.model.features import DISPLACEMENT_SCALE
from surfsup.model.state import Surroundings
from surfsup.scene import SURFACE_CLEARANCE, WALL_CLEARANCE


def clearance_loss(positions: Tensor, around: Surroundings) -> Tensor:
    """How far particles come nearer than the solver ever lets them, mean over all of them, in DISPLACEMENT_SCALE.

    These are what the guard has to push back. In the squared error such a step is as good as one that misses by as much
    on the other side, so without this term the guard moves one of a hundred particles in the frames of an impact.

    Args:
        positions: (N, 3) predicted, metres, before the guard.
        around: container and solid.
    """
    lower, upper = around.lower + WALL_CLEARANCE, around.upper - WALL_CLEARANCE
    short = ((lower - positions).clamp(min=0) + (positions - upper).clamp(min=0)).sum(dim=-1)
    if around.surface is not None:
        # The normal is the distance's gradient; through it alone, for a mesh has no other.
        distance, normal = around.distance_and_normal(positions.detach())
        distance = distance + ((positions - positions.detach()) * normal).sum(dim=-1)
        short = short + (SURFACE_CLEARANCE - distance).clamp(min=0)
    return short.mean() / DISPLACEMENT_SCALE
