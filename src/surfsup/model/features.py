"""What the network is told about each particle, besides its neighbours."""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.model.state import FRAME_TIME, State, Surroundings, free_fall_lag

# Metres beyond which a solid is not felt: six particle radii, the supplement's near-surface threshold.
REACH = 0.09
DISPLACEMENT_SCALE = 3e-4  # metres: the spread of one frame's correction to ballistic motion (measured)
VELOCITY_SCALE = 1.0  # m/s

FEATURES = 21


def lag(state: State, gravity: Tensor) -> Tensor:
    """How much faster a particle ends a frame than its displacement tells (N, 3), in DISPLACEMENT_SCALE.

    It is zero in free fall; after a push late in the frame it holds what the next displacement will show.
    """
    return (FRAME_TIME * state.velocities - state.displacement - free_fall_lag(gravity)) / DISPLACEMENT_SCALE


def node_features(state: State, ahead: Tensor, distance: Tensor, normal: Tensor, around: Surroundings) -> Tensor:
    """The features (N, 21) of every particle.

    Args:
        state: the fluid now.
        ahead: (N, 3) where ballistic motion would take it, metres.
        distance: (N,) signed distance of ``ahead`` to the solid, metres.
        normal: (N, 3) the solid's normal there.
        around: container and gravity.

    The columns: velocity (3), lag (3), change of velocity beyond gravity (3), nearness to the solid (1), its
    normal times that (3), speed into the solid times that (1), nearness to the six walls (6), a constant (1),
    from which the network counts neighbours.
    """
    pushed = FRAME_TIME * (state.velocity_change - FRAME_TIME * around.gravity) / DISPLACEMENT_SCALE
    near_solid = nearness(distance)[:, None]
    into_solid = (state.velocities * normal).sum(dim=-1, keepdim=True)
    walls = torch.cat([ahead - around.lower, around.upper - ahead], dim=-1)
    return torch.cat(
        [
            state.velocities / VELOCITY_SCALE,
            soft_limit(lag(state, around.gravity)),
            soft_limit(pushed),
            near_solid,
            near_solid * normal,
            near_solid * into_solid / VELOCITY_SCALE,
            nearness(walls),
            torch.ones_like(near_solid),
        ],
        dim=-1,
    )


def nearness(distance: Tensor) -> Tensor:
    """1 at contact, 0 from ``REACH`` on, above 1 inside."""
    return (1 - distance / REACH).clamp(0, 2)


def soft_limit(values: Tensor) -> Tensor:
    """Small values as they are, large ones compressed: an impact is a hundred times a ripple."""
    return torch.asinh(values)
