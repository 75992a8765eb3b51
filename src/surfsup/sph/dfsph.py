"""What the solver's own rule makes of a frame, before the network corrects it.

In each of its steps the solver (DFSPH: Bender and Koschier, "Divergence-Free SPH for Incompressible and Viscous
Fluids", 2017) first takes from velocities what makes density rise, then lets viscosity and gravity act, then takes
what would make density too high at the step's end. It goes over all particles once for the former and two to six times
for the latter (measured), so what it does in a step is local, and so cheap: a particle alone that comes near a wall
loses half of its way in, exactly. Here a frame is as many steps as the solver's, each with one sweep that makes both
pressures from the same look at the neighbors, and who is whose neighbor is that of the frame's middle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from surfsup.scene import SPACING
from surfsup.sph.boundary.density import flat_share, solid_density
from surfsup.sph.boundary.walls import walls_density
from surfsup.sph.kernel_sums import Graph, graph, kernel_sums
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.neighbor_search import NeighborList
from surfsup.sph.state import SOLVER_STEPS, STEP_TIME, Environment, ParticleState

# Shares of a sweep that are made. One of the solver's makes a half; of the second kind it makes two, of which one and a
# bit are enough, and the water rests the better for it (measured).
OF_RISE, OF_EXCESS = 0.5, 0.6
# 1/s: how slow a rise is not reckoned with in advance. Reckoned with, it swings from step to step in deep water, and a
# pool trembles (docs/experiments.md, "why the pool trembled"); in a splash rates spread by 1.4 to 9.
SLOW = 1.0
LEAST = 1e-5  # 1/m²: where density depends on places no more than this, nothing can be done
VISCOSITY = 0.01  # m²/s: the solver's
DIMENSIONS = 10  # 2 (d + 2) of the viscosity's Laplacian
SOFTENED = 0.01  # of the squared radius, that keeps it finite where particles meet
MOST_DENSE = 0.2  # more too dense it is not taken to be: a start, or what the model has erred by, may not burst


@dataclass(frozen=True)
class LastStep:
    """What the last of a frame's steps begins with.

    Attributes:
        graph: the neighbors, as they lie there.
        sums: (N, 4, 4), kernel sums of the neighbors' velocity and of one.
        velocities: (N, 3) there, but for what gravity has added since the frame's start, m/s.
        of_solids: (N,), what solid and walls add to density.
        slope_of_solids: (N, 3), its slope, 1/m.
        slope: (N, 3), that of density all in all, 1/m.
        too_dense: (N,), by how much density is higher than it may be, at most ``MOST_DENSE``.
        rise: (N,), how fast density rises, 1/s.
    """

    graph: Graph
    sums: Tensor
    velocities: Tensor
    of_solids: Tensor
    slope_of_solids: Tensor
    slope: Tensor
    too_dense: Tensor
    rise: Tensor


def sweep(
    state: ParticleState,
    ahead: Tensor,
    distance: Tensor,
    normal: Tensor,
    environment: Environment,
    near: NeighborList,
    radius: float,
) -> tuple[Tensor, Tensor, LastStep]:
    """What the rule adds to the velocities (N, 3) in m/s and places (N, 3) in meters of ballistic motion.

    Away from all else, as in a free fall, that is nothing.

    Args:
        state: the fluid now.
        ahead: (N, 3) where ballistic motion would take it, meters.
        distance: (N,) of the solid from there, meters.
        normal: (N, 3) the solid's there.
        environment: container and gravity.
        near: the neighbors halfway to there, within the radius.
        radius: reach of the kernels, meters.
    """
    own, scale = own_density(radius), density_slope(radius)
    faster, farther = torch.zeros_like(ahead), torch.zeros_like(ahead)
    place, allowed = state.positions, None
    for step in range(SOLVER_STEPS):
        fallen = step * STEP_TIME * environment.gravity
        speed = state.velocities + faster
        seen = graph(place, near, radius)
        of_solid, slope_of_solids = of_solids(place, ahead, distance, normal, environment)
        sums = kernel_sums(torch.cat([speed, torch.ones_like(speed[:, :1])], dim=-1), seen)
        density = own * (1 + sums[:, 0, 3]) + of_solid
        slope = scale * sums[:, 1:4, 3] + slope_of_solids
        size = slope.square().sum(dim=-1) + scale**2 * squares(seen)[:, 0]
        ease = torch.where(size > LEAST, 1 / size.clamp(min=LEAST), 0.0)
        if allowed is None:
            # Where it is too high already beside a solid of no map, that is not as flat as it is taken to be.
            beside = (
                (distance < KERNEL_SUPPORT)
                if environment.boundary_map is None
                else torch.zeros_like(distance, dtype=torch.bool)
            )
            allowed = torch.where(beside, density.clamp(min=1), 1.0)

        rise = rate_of(sums, speed, scale) + (slope_of_solids * (speed + fallen)).sum(dim=-1)
        too_dense = (density - allowed).clamp(max=MOST_DENSE)
        last = LastStep(seen, sums, speed, of_solid, slope_of_solids, slope, too_dense, rise)
        against_rise = OF_RISE * rise.clamp(min=0)
        by_gravity = STEP_TIME * (slope_of_solids * environment.gravity).sum(dim=-1)
        excess = too_dense / STEP_TIME + fast(rise - against_rise) + by_gravity
        pressures = ease * (against_rise + OF_EXCESS * excess.clamp(min=0))
        dragged = STEP_TIME * viscosity(speed, place, density, scale, radius, seen)
        faster = faster - pushed(pressures, slope, scale, seen) + dragged
        farther = farther + STEP_TIME * faster
        place = place + STEP_TIME * (state.velocities + faster + fallen + STEP_TIME * environment.gravity)
    return faster, farther, last


def of_solids(
    place: Tensor, looked: Tensor, distance: Tensor, normal: Tensor, environment: Environment
) -> tuple[Tensor, Tensor]:
    """What solid and walls add to density (N,) at a ``place`` (N, 3), and its slope (N, 3) there, a meter.

    Where the solid has no map it is taken for flat, by its ``distance`` (N,) and ``normal`` (N, 3) at the places
    ``looked`` at (N, 3).
    """
    if environment.boundary_map is None:
        distance = distance + ((place - looked) * normal).sum(dim=-1)
        share = flat_share(distance)
    else:
        distance, share, normal = environment.boundary_map.look(place)
    of_solid, rise = solid_density(distance, share)
    of_walls, slope = walls_density(place, environment)
    return of_solid + of_walls, slope - (rise / KERNEL_SUPPORT)[:, None] * normal


def fast(rise: Tensor) -> Tensor:
    """By how much density rises or falls (N,) faster than what is SLOW, 1/s."""
    return rise - rise.clamp(-SLOW, SLOW)


def own_density(radius: float) -> float:
    """A particle's share of its own density, in units of the lattice's, by a kernel that reaches ``radius`` meters."""
    return 8 / math.pi * (SPACING / radius) ** 3


def density_slope(radius: float) -> float:
    """From the slope of kernels that reach ``radius`` meters to that of density, 1/m."""
    return 2 * own_density(radius) / radius


def squares(seen: Graph) -> Tensor:
    """The sum over neighbors of the squared slope (N, 1): with the square of their sum, how stiff density is."""
    near = seen.neighborhood
    slopes = seen.kernels[:, 1:].square().sum(dim=-1)
    return slopes.new_zeros(len(seen)).index_add(0, near.receivers, slopes)[:, None]


def rate_of(sums: Tensor, velocities: Tensor, scale: float) -> Tensor:
    """How fast the fluid's density (N,) rises by ``velocities`` (N, 3), 1/s, of their kernel sums and those of one."""
    against = sums[:, 1:4, :3] - sums[:, 1:4, 3:] * velocities[:, None]
    return -scale * against.diagonal(dim1=1, dim2=2).sum(dim=-1)


def pushed(taken: Tensor, slope: Tensor, scale: float, seen: Graph) -> Tensor:
    """The velocities (N, 3) that pressures ``taken`` (N,) take from the particles: their own, and their neighbors'."""
    nothing = torch.zeros_like(slope)
    sums = kernel_sums(torch.cat([taken[:, None], nothing], dim=-1), seen)
    return taken[:, None] * slope + scale * sums[:, 1:4, 0]


def viscosity(speed: Tensor, place: Tensor, density: Tensor, scale: float, radius: float, seen: Graph) -> Tensor:
    """What viscosity does to particles (N, 3), m/s²: the solver's.

    The Laplacian of velocities is that of J. J. Monaghan, "Smoothed particle hydrodynamics", Reports on Progress in
    Physics 68, 2005: of two neighbors only the speed at which they part counts. The solver divides by the neighbor's
    density, here it is the particle's own: the neighbor's is not known yet.
    """
    near = seen.neighborhood
    apart = place.index_select(0, near.senders) - place.index_select(0, near.receivers)
    parting = speed.index_select(0, near.senders) - speed.index_select(0, near.receivers)
    along = (parting * seen.kernels[:, 1:]).sum(dim=-1) / density.index_select(0, near.receivers)
    each = along / (apart.square().sum(dim=-1) + SOFTENED * radius**2)
    drag = torch.zeros_like(speed).index_add(0, near.receivers, each[:, None] * apart)
    return DIMENSIONS * VISCOSITY * scale * drag
