"""What the solver's own rule makes of a frame, before the network corrects it.

In each of its steps the solver (DFSPH: Bender and Koschier, "Divergence-Free SPH for Incompressible and Viscous
Fluids", 2017) first takes from velocities what makes density rise, then lets viscosity and gravity act, then takes what
would make density too high at the step's end. It goes over all particles but once or twice for each, so what it does in
a step is local, and so cheap: a particle alone that comes near a wall loses half of its way in, exactly. Here a frame
is as many steps as the solver's, with one sweep of either kind, and who is whose neighbour is that of the frame's
middle.
"""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.model.convolution import Graph, graph, kernel_sums
from surfsup.model.neighbours import Neighbourhood
from surfsup.model.solid_density import SUPPORT, flat_share, solid_density
from surfsup.model.state import SOLVER_STEPS, STEP_TIME, State, Surroundings
from surfsup.model.walls import walls_density

# Shares of a sweep that are made: one of the solver's makes a half, but of the second kind it makes two (measured).
OF_RISE, OF_EXCESS = 0.5, 0.8
LEAST = 1e-5  # 1/m²: where density depends on places no more than this, nothing can be done
VISCOSITY = 0.01  # m²/s: the solver's
DIMENSIONS = 10  # 2 (d + 2) of the viscosity's Laplacian
SOFTENED = 0.01  # of the squared radius, that keeps it finite where particles meet
MOST_DENSE = 0.2  # more too dense it is not taken to be: a start, or what the model has erred by, may not burst
MARGIN = 3e-3  # metres that neighbours may be farther apart in the frame's middle than the kernel reaches


def sweep(
    state: State,
    ahead: Tensor,
    distance: Tensor,
    normal: Tensor,
    around: Surroundings,
    near: Neighbourhood,
    own: float,
    radius: float,
) -> tuple[Tensor, Tensor]:
    """What the rule adds to the velocities (N, 3) in m/s and places (N, 3) in metres of ballistic motion.

    Away from all else, as in a free fall, that is nothing.

    Args:
        state: the fluid now.
        ahead: (N, 3) where ballistic motion would take it, metres.
        distance: (N,) of the solid from there, metres.
        normal: (N, 3) the solid's there.
        around: container and gravity.
        near: the neighbours halfway to there, within the radius and ``MARGIN``.
        own: a particle's share of its own density, in units of the lattice's.
        radius: reach of the kernels, metres.
    """
    scale = 2 * own / radius  # from the kernels' slope to density's, a metre
    faster, farther = torch.zeros_like(ahead), torch.zeros_like(ahead)
    allowed = None
    for step in range(SOLVER_STEPS):
        fallen = step * STEP_TIME * around.gravity
        place = state.positions + step * STEP_TIME * (state.velocities + 0.5 * (STEP_TIME * around.gravity + fallen))
        place = place + farther
        seen = graph(place, near, radius)
        density_of_solids, slope_of_solids = of_solids(place, ahead, distance, normal, around)
        speed = state.velocities + faster
        sums = kernel_sums(torch.cat([speed, torch.ones_like(speed[:, :1])], dim=-1), seen)
        density = own * (1 + sums[:, 0, 3]) + density_of_solids
        slope_of_fluid = scale * sums[:, 1:4, 3]
        slope = slope_of_fluid + slope_of_solids
        size = slope.square().sum(dim=-1) + scale**2 * squares(seen)[:, 0]
        ease = torch.where(size > LEAST, 1 / size.clamp(min=LEAST), 0.0)
        if allowed is None:
            # Where it is too high already beside a solid of no map, that is not as flat as it is taken to be.
            beside = (distance < SUPPORT) if around.felt is None else torch.zeros_like(distance, dtype=torch.bool)
            allowed = torch.where(beside, density.clamp(min=1), 1.0)

        rise = slope_rate(slope_of_fluid, speed, scale, sums) + (slope_of_solids * (speed + fallen)).sum(dim=-1)
        faster = faster - pushed((OF_RISE * ease * rise).clamp(min=0), slope, scale, seen)
        speed = state.velocities + faster
        dragged = STEP_TIME * viscosity(speed, place, density, scale, radius, seen)
        falling = speed + fallen + STEP_TIME * around.gravity
        rise = rate_of(speed, slope_of_fluid, scale, seen) + (slope_of_solids * falling).sum(dim=-1)
        excess = (density - allowed).clamp(max=MOST_DENSE) / STEP_TIME + rise
        faster = faster - pushed((OF_EXCESS * ease * excess).clamp(min=0), slope, scale, seen) + dragged
        farther = farther + STEP_TIME * faster
    return faster, farther


def of_solids(
    place: Tensor, looked: Tensor, distance: Tensor, normal: Tensor, around: Surroundings
) -> tuple[Tensor, Tensor]:
    """What solid and walls add to density (N,) at a ``place`` (N, 3), and its slope (N, 3) there, a metre.

    Where the solid has no map it is taken for flat, by its ``distance`` (N,) and ``normal`` (N, 3) at the places
    ``looked`` at (N, 3).
    """
    if around.felt is None:
        distance = distance + ((place - looked) * normal).sum(dim=-1)
        share = flat_share(distance)
    else:
        distance, share, normal = around.felt.look(place)
    of_solid, rise = solid_density(distance, share)
    of_walls, slope = walls_density(place, around)
    return of_solid + of_walls, slope - (rise / SUPPORT)[:, None] * normal


def squares(seen: Graph) -> Tensor:
    """The sum over neighbours of the squared slope (N, 1): with the square of their sum, how stiff density is."""
    near = seen.neighbourhood
    slopes = seen.kernels[:, 1:].square().sum(dim=-1)
    return slopes.new_zeros(len(seen)).index_add(0, near.receivers, slopes)[:, None]


def rate_of(velocities: Tensor, slope: Tensor, scale: float, seen: Graph) -> Tensor:
    """How fast the fluid's density (N,) rises by ``velocities`` (N, 3), 1/s."""
    sums = kernel_sums(torch.cat([velocities, torch.zeros_like(velocities[:, :1])], dim=-1), seen)
    return slope_rate(slope, velocities, scale, sums)


def slope_rate(slope: Tensor, velocities: Tensor, scale: float, sums: Tensor) -> Tensor:
    """The same (N,) where the kernel sums of the velocities are known."""
    return (slope * velocities).sum(dim=-1) - scale * sums[:, 1:4, :3].diagonal(dim1=1, dim2=2).sum(dim=-1)


def pushed(taken: Tensor, slope: Tensor, scale: float, seen: Graph) -> Tensor:
    """The velocities (N, 3) that pressures ``taken`` (N,) take from the particles: their own, and their neighbours'."""
    nothing = torch.zeros_like(slope)
    sums = kernel_sums(torch.cat([taken[:, None], nothing], dim=-1), seen)
    return taken[:, None] * slope + scale * sums[:, 1:4, 0]


def viscosity(speed: Tensor, place: Tensor, density: Tensor, scale: float, radius: float, seen: Graph) -> Tensor:
    """What viscosity does to particles (N, 3), m/s²: the solver's.

    The Laplacian of velocities is that of J. J. Monaghan, "Smoothed particle hydrodynamics", Reports on Progress in
    Physics 68, 2005: of two neighbours only the speed at which they part counts.
    """
    near = seen.neighbourhood
    apart = place.index_select(0, near.senders) - place.index_select(0, near.receivers)
    parting = speed.index_select(0, near.senders) - speed.index_select(0, near.receivers)
    along = (parting * seen.kernels[:, 1:]).sum(dim=-1) / density.index_select(0, near.senders)
    each = along / (apart.square().sum(dim=-1) + SOFTENED * radius**2)
    drag = torch.zeros_like(speed).index_add(0, near.receivers, each[:, None] * apart)
    return DIMENSIONS * VISCOSITY * scale * drag
