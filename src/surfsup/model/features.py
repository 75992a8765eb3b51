"""What the network is told about each particle, besides its neighbours."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from surfsup.model.convolution import KERNELS, Graph, kernel_sums
from surfsup.model.state import FRAME_TIME, State, Surroundings
from surfsup.model.sweeps import of_solids, squares, sweep
from surfsup.scene import SPACING

# Metres beyond which a solid is not felt: the support of the solver's kernel, four particle radii. Told of what is
# farther off, the model pushed water in free fall along a wall aside, by millimetres until the impact (measured).
REACH = 0.06
DISPLACEMENT_SCALE = 1e-4  # metres: the spread of what is wrong with the solver's rule after a frame (measured)
# What the network is told is of like size, whatever it is, in the splash: it learns faster so (measured).
VELOCITY_SCALE = 0.3  # m/s
NEARNESS_SCALE, DENSITY_SCALE = 0.25, 0.1
# The largest kernel sums found in true water, of either sign. A model has learned nothing of what is beyond, and
# factors made of such sums throw particles out of the water at hundreds of metres a second.
THICKEST = (3.0, 2.5, 2.5, 2.5, 4.0, 1.5)
DENSEST = 2.0  # beyond which ballistic motion is not told to lead

ACTIONS = 37
SURROUNDINGS = KERNELS + 2


@dataclass(frozen=True)
class Features:
    """What the network is told, and what its answer is added to.

    Attributes:
        acts: (N, 37), what acts on each particle.
        lie: (N, 6), how its neighbours lie.
        faster: (N, 3), m/s that the sweeps add to the velocity of ballistic motion.
        farther: (N, 3), metres that they add to its place.
    """

    acts: Tensor
    lie: Tensor
    faster: Tensor
    farther: Tensor


def observe_features(
    state: State, ahead: Tensor, distance: Tensor, normal: Tensor, around: Surroundings, graph: Graph, radius: float
) -> Features:
    """All that the network is told of a state.

    No velocity is told as it is, only against neighbours, the solid and the walls: so what happens inside the
    fluid does not depend on how fast all of it moves. In a free fall away from everything nothing acts.

    Args:
        state: the fluid now.
        ahead: (N, 3) where ballistic motion would take it, metres.
        distance: (N,) signed distance of ``ahead`` to the solid, metres.
        normal: (N, 3) the solid's normal there.
        around: container and gravity.
        graph: the neighbours halfway to ``ahead``, all within the radius and ``sweeps.MARGIN``.
        radius: reach of the graph's kernels, metres.

    The columns of what acts: what the sweeps add to velocity (3) and to place (3), nearness to the solid (1), its
    normal times that (3), speed away from the solid times that (1), nearness to the six walls (6), speed away from each
    times that (6), kernel sums of the neighbours' velocity against the particle's own (12), density above the lattice's
    where ballistic motion leads (1), and the rate at which it rises (1).

    How the neighbours lie: kernel sums of one, that is density and its slope (4), the sum of the squares of their
    slopes (1), the density of solid and walls (1), no larger than in true water.
    """
    near_solid = nearness(distance)[:, None]
    from_solid = (state.velocities * normal).sum(dim=-1, keepdim=True)
    walls = nearness(torch.cat([ahead - around.lower, around.upper - ahead], dim=-1))
    from_walls = torch.cat([state.velocities, -state.velocities], dim=-1)
    sums = kernel_sums(torch.cat([state.velocities, torch.ones_like(near_solid)], dim=-1), graph)
    lie = sums[:, :, 3]
    against = sums[:, :, :3] - lie[:, :, None] * state.velocities[:, None]
    stiffness = squares(graph)

    own = own_density(radius)
    solid, slope_of_solids = of_solids(ahead, ahead, distance, normal, around)
    solid = solid[:, None]
    from_neighbours = -2 * own * against[:, 1:4].diagonal(dim1=1, dim2=2).sum(dim=-1, keepdim=True) / radius
    rate = from_neighbours + (slope_of_solids * state.velocities).sum(dim=-1, keepdim=True)  # 1/s
    above = own * (1 + lie[:, :1]) + FRAME_TIME / 2 * from_neighbours + solid - 1

    faster, farther = sweep(state, ahead, distance, normal, around, graph.neighbourhood, own, radius)
    acts = torch.cat(
        [
            faster / VELOCITY_SCALE,
            farther / (FRAME_TIME * VELOCITY_SCALE),
            near_solid / NEARNESS_SCALE,
            near_solid / NEARNESS_SCALE * normal,
            near_solid * from_solid / VELOCITY_SCALE,
            walls / NEARNESS_SCALE,
            walls * from_walls / VELOCITY_SCALE,
            against.flatten(1) / VELOCITY_SCALE,
            above.clamp(0, DENSEST - 1) / DENSITY_SCALE,
            rate * FRAME_TIME / DENSITY_SCALE,
        ],
        dim=-1,
    )
    told = torch.cat([lie, stiffness, solid], dim=-1)
    thickest = told.new_tensor(THICKEST)
    return Features(acts, torch.minimum(torch.maximum(told, -thickest), thickest), faster, farther)


def own_density(radius: float) -> float:
    """A particle's share of its own density, in units of the lattice's, by a kernel that reaches ``radius`` metres."""
    return 8 / math.pi * (SPACING / radius) ** 3


def nearness(distance: Tensor) -> Tensor:
    """1 at contact, 0 from ``REACH`` on, above 1 inside."""
    return (1 - distance / REACH).clamp(0, 2)
