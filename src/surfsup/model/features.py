"""What the network is told about each particle, besides its neighbours."""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.model.convolution import CLOSE_DIRECTION, CLOSE_WINDOW, KERNELS, Graph, kernel_sums
from surfsup.model.state import FRAME_TIME, State, Surroundings

# Metres beyond which a solid is not felt: the support of the solver's kernel, four particle radii. Told of what is
# farther off, the model pushed water in free fall along a wall aside, by millimetres until the impact (measured).
REACH = 0.06
DISPLACEMENT_SCALE = 3e-4  # metres: the spread of one frame's correction to ballistic motion (measured)
VELOCITY_SCALE = 1.0  # m/s
# The largest kernel sums found in true water, of either sign. A model has learned nothing of what is beyond, and
# factors made of such sums throw particles out of the water at hundreds of metres a second.
THICKEST = (3.2, 1.8, 2.5, 2.5, 2.5, 1.5, 1.5, 1.5)
CROWDED = 0.6  # sum of the close window above which neighbours are nearer than on the lattice, where it is 0.53

ACTIONS = 45
SURROUNDINGS = KERNELS


def observe_features(
    state: State, ahead: Tensor, distance: Tensor, normal: Tensor, around: Surroundings, graph: Graph
) -> tuple[Tensor, Tensor]:
    """What acts on every particle (N, 45), and how its neighbours lie (N, 8).

    No velocity is told as it is, only against neighbours, the solid and the walls: so what happens inside the
    fluid does not depend on how fast all of it moves. In a free fall away from everything nothing acts.

    Args:
        state: the fluid now.
        ahead: (N, 3) where ballistic motion would take it, metres.
        distance: (N,) signed distance of ``ahead`` to the solid, metres.
        normal: (N, 3) the solid's normal there.
        around: container and gravity.
        graph: the neighbours at ``ahead``.

    The columns of what acts: nearness to the solid (1), its normal times that (3), speed away from the solid times that
    (1), nearness to the six walls (6), speed away from each times that (6), kernel sums of the neighbours' velocity
    against the particle's own (24), crowding (1) and its direction (3). How the neighbours lie: kernel sums of one (8),
    that is density and its slope, no larger than in true water.
    """
    near_solid = nearness(distance)[:, None]
    from_solid = (state.velocities * normal).sum(dim=-1, keepdim=True)
    walls = nearness(torch.cat([ahead - around.lower, around.upper - ahead], dim=-1))
    from_walls = torch.cat([state.velocities, -state.velocities], dim=-1)
    ones = torch.ones_like(near_solid)
    sums = kernel_sums(torch.cat([state.velocities, ones], dim=-1), graph)
    density = sums[:, :, 3]
    against = sums[:, :, :3] - density[:, :, None] * state.velocities[:, None]
    crowding = (density[:, CLOSE_WINDOW : CLOSE_WINDOW + 1] - CROWDED).clamp(min=0)
    acts = torch.cat(
        [
            near_solid,
            near_solid * normal,
            near_solid * from_solid / VELOCITY_SCALE,
            walls,
            walls * from_walls / VELOCITY_SCALE,
            soft_limit(against.flatten(1) * (FRAME_TIME / DISPLACEMENT_SCALE)),
            crowding,
            crowding * density[:, CLOSE_DIRECTION],
        ],
        dim=-1,
    )
    thickest = density.new_tensor(THICKEST)
    return acts, torch.minimum(torch.maximum(density, -thickest), thickest)


def nearness(distance: Tensor) -> Tensor:
    """1 at contact, 0 from ``REACH`` on, above 1 inside."""
    return (1 - distance / REACH).clamp(0, 2)


def soft_limit(values: Tensor) -> Tensor:
    """Small values as they are, large ones compressed: an impact is a hundred times a ripple."""
    return torch.asinh(values)
