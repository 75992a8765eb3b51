"""What the network is told about each particle, besides its neighbors."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from surfsup.sph.dfsph import squares, sweep
from surfsup.sph.kernel_sums import KERNELS, Graph
from surfsup.sph.neighbor_search import NeighborList
from surfsup.sph.state import FRAME_TIME, Environment, ParticleState

DISPLACEMENT_SCALE = 1e-4  # meters: the spread of what is wrong with the solver's rule after a frame (measured)
# What the network is told is of like size, whatever it is, in the splash: it learns faster so (measured).
VELOCITY_SCALE = 0.3  # m/s
SLOPE_SCALE, DENSITY_SCALE = 20.0, 0.02  # 1/m; the lattice's
# The largest kernel sums found in true water, of either sign. A model has learned nothing of what is beyond, and
# factors made of such sums throw particles out of the water at hundreds of meters a second.
THICKEST = (3.0, 2.5, 2.5, 2.5, 4.0, 1.5)

ACTIONS = 14
RISE = 13  # the column of density's rise
SURROUNDINGS = KERNELS + 2


@dataclass(frozen=True)
class Features:
    """What the network is told, and what its answer is added to.

    Attributes:
        acts: (N, 14), what acts on each particle.
        lie: (N, 6), how its neighbors lie.
        faster: (N, 3), m/s that the sweeps add to the velocity of ballistic motion.
        farther: (N, 3), meters that they add to its place.
        slope: (N, 3) of density at the last of the sweeps' steps, 1/m.
        graph: the neighbors halfway there, as they lie in the last of the sweeps' steps.
    """

    acts: Tensor
    lie: Tensor
    faster: Tensor
    farther: Tensor
    slope: Tensor
    graph: Graph


def observe_features(
    state: ParticleState,
    ahead: Tensor,
    distance: Tensor,
    normal: Tensor,
    environment: Environment,
    near: NeighborList,
    radius: float,
) -> Features:
    """All that the network is told of a state: what the sweeps have made, and what the last of their steps has seen.

    No velocity is told as it is, only against neighbors: so what happens inside the fluid does not depend on how fast
    all of it moves. In a free fall away from everything nothing acts.

    Args:
        state: the fluid now.
        ahead: (N, 3) where ballistic motion would take it, meters.
        distance: (N,) signed distance of ``ahead`` to the solid, meters.
        normal: (N, 3) the solid's normal there.
        environment: container and gravity.
        near: the neighbors halfway to ``ahead``, within the radius.
        radius: reach of the kernels, meters.

    The columns of what acts: what the sweeps add to velocity (3) and to place (3), the slope of what solid and walls
    add to density (3), the neighbors' velocity against the particle's own, weighed by the smoothing kernel (3), by how
    much density is too high (1), and the rate at which it rises (1).

    How the neighbors lie: kernel sums of one, that is density and its slope (4), the sum of the squares of their
    slopes (1), the density of solid and walls (1), no larger than in true water.
    """
    faster, farther, last = sweep(state, ahead, distance, normal, environment, near, radius)
    lie = last.sums[:, :, 3]
    against = last.sums[:, 0, :3] - lie[:, :1] * last.velocities
    acts = torch.cat(
        [
            faster / VELOCITY_SCALE,
            farther / (FRAME_TIME * VELOCITY_SCALE),
            last.slope_of_solids / SLOPE_SCALE,
            against / VELOCITY_SCALE,
            last.too_dense.clamp(min=0)[:, None] / DENSITY_SCALE,
            last.rise[:, None] * FRAME_TIME / DENSITY_SCALE,
        ],
        dim=-1,
    )
    told = torch.cat([lie, squares(last.graph), last.of_solids[:, None]], dim=-1)
    thickest = told.new_tensor(THICKEST)
    told = torch.minimum(torch.maximum(told, -thickest), thickest)
    return Features(acts, told, faster, farther, last.slope, last.graph)
