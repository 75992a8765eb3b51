"""What a few sweeps of the solver's own rule make of a frame, before the network corrects it.

In each of its steps the solver (DFSPH: Bender and Koschier, "Divergence-Free SPH for Incompressible and Viscous
Fluids", 2017) first takes from velocities what makes density rise, then what would make it too high at the step's end.
It goes over all particles but once or twice for each, so what it does in a step is local: a particle alone that comes
near a wall loses half of its way in, exactly. Here a frame is two steps instead of five, neighbours and kernels are
those halfway through the frame, solids are taken for flat, and each step has one sweep of either kind.
"""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.model.convolution import Graph, kernel_sums
from surfsup.model.solid_density import SUPPORT, solid_density
from surfsup.model.state import FRAME_TIME, State, Surroundings

STEPS = 2
STEP = FRAME_TIME / STEPS
# Shares of a sweep that are made: one of the solver's makes a half, and a step of ours is two and a half of its steps.
OF_RISE, OF_EXCESS = 0.82, 0.5
LEAST = 1e-5  # 1/m²: where density depends on places no more than this, nothing can be done


def sweep(
    state: State,
    halfway: Tensor,
    distance: Tensor,
    normal: Tensor,
    around: Surroundings,
    graph: Graph,
    sums: Tensor,
    stiffness: Tensor,
    own: float,
    radius: float,
) -> tuple[Tensor, Tensor]:
    """What the sweeps add to the velocities (N, 3) in m/s and places (N, 3) in metres of ballistic motion.

    Away from all else, as in a free fall, that is exactly nothing.

    Args:
        state: the fluid now.
        halfway: (N, 3) where it is in the middle of the frame, metres.
        distance: (N,) of the solid from there, metres.
        normal: (N, 3) the solid's there.
        around: container and gravity.
        graph: the neighbours there.
        sums: (N, 4, 4) kernel sums of the neighbours' velocities and of one.
        stiffness: (N,) the sum over neighbours of the squared slope of the kernel.
        own: a particle's share of its own density, in units of the lattice's.
        radius: reach of the kernels, metres.
    """
    scale = 2 * own / radius  # from the kernels' slope to density's, a metre
    slope_of_fluid = scale * sums[:, 1:4, 3]
    stiffness = scale**2 * stiffness
    rise = slope_rate(slope_of_fluid, state.velocities, scale, sums)
    fluid = own * (1 + sums[:, 0, 3]) - FRAME_TIME / 2 * rise  # density at the frame's start
    faster, farther = torch.zeros_like(halfway), torch.zeros_like(halfway)
    rising, allowed = rise, None
    for step in range(STEPS):
        fallen = step * STEP * around.gravity
        speed = state.velocities + fallen + faster
        place = state.positions + step * STEP * (state.velocities + 0.5 * (STEP * around.gravity + fallen)) + farther
        density = fluid + of_solids(place, halfway, distance, normal, around)[0]
        slope_of_solids = of_solids(place + 0.5 * STEP * speed, halfway, distance, normal, around)[1]
        slope = slope_of_fluid + slope_of_solids
        size = slope.square().sum(dim=-1) + stiffness
        ease = torch.where(size > LEAST, 1 / size.clamp(min=LEAST), 0.0)
        # Where it is too high already, the solid is not as flat as it is taken to be, or the model has erred before.
        allowed = density.clamp(min=1) if allowed is None else allowed

        taken = (OF_RISE * ease * (rising + (slope_of_solids * speed).sum(dim=-1))).clamp(min=0)
        faster = faster - pushed(taken, slope, scale, graph)
        rising = rise + rate_of(faster, slope_of_fluid, scale, graph)
        speed = state.velocities + (fallen + STEP * around.gravity) + faster
        excess = (density - allowed) / STEP + rising + (slope_of_solids * speed).sum(dim=-1)
        faster = faster - pushed((OF_EXCESS * ease * excess).clamp(min=0), slope, scale, graph)
        farther = farther + STEP * faster
        if step + 1 < STEPS:
            rising = rise + rate_of(faster, slope_of_fluid, scale, graph)
            fluid = fluid + STEP * rising
    return faster, farther


def of_solids(
    place: Tensor, looked: Tensor, distance: Tensor, normal: Tensor, around: Surroundings
) -> tuple[Tensor, Tensor]:
    """What solid and walls add to density (N,) at a ``place`` (N, 3), and its slope (N, 3) there, a metre.

    The solid is known by its ``distance`` (N,) and ``normal`` (N, 3) at the places ``looked`` at (N, 3).
    """
    away = ((place - looked) * normal).sum(dim=-1)
    all_of_them = torch.cat([(distance + away)[:, None], place - around.lower, around.upper - place], dim=-1)
    density, slope = solid_density(all_of_them)
    return density.sum(dim=-1), (slope[:, 4:7] - slope[:, 1:4] - slope[:, :1] * normal) / SUPPORT


def rate_of(velocities: Tensor, slope: Tensor, scale: float, graph: Graph) -> Tensor:
    """How fast the fluid's density (N,) rises by ``velocities`` (N, 3), 1/s."""
    sums = kernel_sums(torch.cat([velocities, torch.zeros_like(velocities[:, :1])], dim=-1), graph)
    return slope_rate(slope, velocities, scale, sums)


def slope_rate(slope: Tensor, velocities: Tensor, scale: float, sums: Tensor) -> Tensor:
    """The same (N,) where the kernel sums of the velocities are known."""
    return (slope * velocities).sum(dim=-1) - scale * sums[:, 1:4, :3].diagonal(dim1=1, dim2=2).sum(dim=-1)


def pushed(taken: Tensor, slope: Tensor, scale: float, graph: Graph) -> Tensor:
    """The velocities (N, 3) that pressures ``taken`` (N,) take from the particles: their own, and their neighbours'."""
    nothing = torch.zeros_like(slope)
    sums = kernel_sums(torch.cat([taken[:, None], nothing], dim=-1), graph)
    return taken[:, None] * slope + scale * sums[:, 1:4, 0]
