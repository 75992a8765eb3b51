"""The substeps of a frame by DFSPH, in torch with gradients.

Bender and Koschier, "Divergence-Free SPH for Incompressible and Viscous Fluids", 2017. In each of its steps the
reference first removes the density rate from the velocities (divergence solve), then applies viscosity and gravity,
then removes the density error expected at the step's end (density solve). The divergence solve takes one iteration, the
density solve two to six (measured). Here a substep has one iteration for both: one pass over the neighbors gives both
pressures. All substeps of a frame use the neighbor list of the frame's middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from surfsup.scene import SPACING
from surfsup.sph.boundary.density import plane_fraction, solid_density
from surfsup.sph.boundary.walls import walls_density
from surfsup.sph.environment import Environment
from surfsup.sph.kernel_sums import KernelGraph, kernel_graph, kernel_sums
from surfsup.sph.kernels import KERNEL_PEAK, KERNEL_SUPPORT
from surfsup.sph.neighbor_search import NeighborList
from surfsup.sph.state import SUBSTEP_TIME, SUBSTEPS, ParticleState

SELF_DENSITY = KERNEL_PEAK * SPACING**3  # of a lone particle, relative to the rest density
GRADIENT_SCALE = 2 * SELF_DENSITY / KERNEL_SUPPORT  # 1/m, from sums of kernel gradients to the density gradient

# Fractions of density rate and density error that a substep removes. The reference removes half in an iteration, and
# iterates the density solve at least twice. Slightly more than one such iteration suffices, and the water is calmer
# (measured).
DIVERGENCE_RELAXATION, DENSITY_RELAXATION = 0.5, 0.6
# 1/s. Density rates below this do not enter the predicted density error: in deep water their signs would alternate from
# substep to substep, and a pool would tremble (docs/log.md). In a splash their standard deviation is 1.4 to 9.
DIVERGENCE_DEADBAND = 1.0
MIN_SQUARED_GRADIENT = 1e-5  # 1/m²: where density depends less on positions, pressure is zero
VISCOSITY = 0.01  # m²/s, the reference's
LAPLACIAN_FACTOR = 10  # 2 (d + 2) in d = 3 dimensions
VISCOSITY_SOFTENING = 0.01  # of the squared kernel support, keeps viscosity finite where particles meet
MAX_DENSITY_ERROR = 0.2  # larger errors are cut, so that a compressed start does not burst


@dataclass(frozen=True)
class Substep:
    """Quantities at the start of a substep; densities are relative to the rest density.

    Attributes:
        graph: the neighbors with their kernels.
        kernel_sum: (N,) sum of kernels W / W(0).
        gradient_sum: (N, 3) sum of kernel gradients.
        squared_gradient_sum: (N,) sum of squared kernel gradients.
        velocity_difference: (N, 3) kernel-weighted sum of neighbors' velocities minus the particle's, m/s.
        boundary_density: (N,) of solid and walls.
        boundary_gradient: (N, 3) its gradient, 1/m.
        density_gradient: (N, 3) of the whole density, 1/m.
        density_error: (N,) density above the rest density, at most ``MAX_DENSITY_ERROR``.
        density_rate: (N,) 1/s.
    """

    graph: KernelGraph
    kernel_sum: Tensor
    gradient_sum: Tensor
    squared_gradient_sum: Tensor
    velocity_difference: Tensor
    boundary_density: Tensor
    boundary_gradient: Tensor
    density_gradient: Tensor
    density_error: Tensor
    density_rate: Tensor


def solve_frame(
    state: ParticleState,
    predicted_positions: Tensor,
    distance: Tensor,
    normal: Tensor,
    environment: Environment,
    neighbors: NeighborList,
) -> tuple[Tensor, Tensor, Substep]:
    """Changes of velocity (N, 3) in m/s and position (N, 3) in meters against ballistic motion, and the last substep.

    Both changes are zero in free fall away from everything else.

    Args:
        state: particles at the frame's start.
        predicted_positions: (N, 3) after ballistic motion, meters.
        distance: (N,) of the solid at the predicted positions, meters.
        normal: (N, 3) of the solid there.
        environment: container, boundary map and gravity.
        neighbors: within the kernel support, at the middle of the ballistic path.
    """
    delta_velocity, delta_position = torch.zeros_like(predicted_positions), torch.zeros_like(predicted_positions)
    positions, rest_density = state.positions, None
    for number in range(SUBSTEPS):
        fallen = number * SUBSTEP_TIME * environment.gravity
        velocities = state.velocities + delta_velocity  # without what gravity has added
        graph = kernel_graph(positions, neighbors)
        boundary, boundary_gradient = boundary_density(positions, predicted_positions, distance, normal, environment)
        sums = kernel_sums(torch.cat([velocities, torch.ones_like(velocities[:, :1])], dim=-1), graph)
        density = SELF_DENSITY * (1 + sums[:, 0, 3]) + boundary
        density_gradient = GRADIENT_SCALE * sums[:, 1:4, 3] + boundary_gradient
        squares = squared_gradient_sum(graph)
        stiffness = density_gradient.square().sum(dim=-1) + GRADIENT_SCALE**2 * squares
        dfsph_factor = torch.where(stiffness > MIN_SQUARED_GRADIENT, 1 / stiffness.clamp(min=MIN_SQUARED_GRADIENT), 0.0)
        if rest_density is None:
            # Without a map the solid is a plane, which is inexact: beside it the initial density is the rest density.
            near = torch.zeros_like(distance, dtype=torch.bool)
            if environment.boundary_map is None:
                near = distance < KERNEL_SUPPORT
            rest_density = torch.where(near, density.clamp(min=1), 1.0)

        density_rate = fluid_density_rate(sums, velocities) + (boundary_gradient * (velocities + fallen)).sum(dim=-1)
        density_error = (density - rest_density).clamp(max=MAX_DENSITY_ERROR)
        substep = Substep(
            graph=graph,
            kernel_sum=sums[:, 0, 3],
            gradient_sum=sums[:, 1:4, 3],
            squared_gradient_sum=squares,
            velocity_difference=sums[:, 0, :3] - sums[:, 0, 3:] * velocities,
            boundary_density=boundary,
            boundary_gradient=boundary_gradient,
            density_gradient=density_gradient,
            density_error=density_error,
            density_rate=density_rate,
        )
        divergence_source = DIVERGENCE_RELAXATION * density_rate.clamp(min=0)
        gravity_rate = SUBSTEP_TIME * (boundary_gradient * environment.gravity).sum(dim=-1)
        density_source = density_error / SUBSTEP_TIME + beyond_deadband(density_rate - divergence_source) + gravity_rate
        pressure = dfsph_factor * (divergence_source + DENSITY_RELAXATION * density_source.clamp(min=0))
        viscous = SUBSTEP_TIME * viscous_acceleration(velocities, positions, density, graph)
        delta_velocity = delta_velocity - pressure_velocity(pressure, density_gradient, graph) + viscous
        delta_position = delta_position + SUBSTEP_TIME * delta_velocity
        positions = positions + SUBSTEP_TIME * (
            state.velocities + delta_velocity + fallen + SUBSTEP_TIME * environment.gravity
        )
    return delta_velocity, delta_position, substep


def boundary_density(
    positions: Tensor, predicted_positions: Tensor, distance: Tensor, normal: Tensor, environment: Environment
) -> tuple[Tensor, Tensor]:
    """Density (N,) of solid and walls at ``positions`` (N, 3), and its gradient (N, 3), 1/m.

    Without a boundary map the solid is a plane, given by ``distance`` (N,) and ``normal`` (N, 3) at the predicted
    positions.
    """
    if environment.boundary_map is None:
        distance = distance + ((positions - predicted_positions) * normal).sum(dim=-1)
        fraction = plane_fraction(distance)
    else:
        distance, fraction, normal = environment.boundary_map.query(positions)
    solid, slope = solid_density(distance, fraction)
    walls, walls_gradient = walls_density(positions, environment.lower, environment.upper)
    return solid + walls, walls_gradient - (slope / KERNEL_SUPPORT)[:, None] * normal


def beyond_deadband(density_rate: Tensor) -> Tensor:
    """The part of density rates (N,) beyond the deadband, 1/s."""
    return density_rate - density_rate.clamp(-DIVERGENCE_DEADBAND, DIVERGENCE_DEADBAND)


def squared_gradient_sum(graph: KernelGraph) -> Tensor:
    """Sum over neighbors of squared kernel gradients (N,): with the square of their sum the stiffness of density."""
    squares = graph.kernels[:, 1:].square().sum(dim=-1)
    return squares.new_zeros(len(graph)).index_add(0, graph.neighbors.receivers, squares)


def fluid_density_rate(sums: Tensor, velocities: Tensor) -> Tensor:
    """Rate (N,) of the fluid's density in 1/s, from the kernel sums of velocities and of one."""
    relative = sums[:, 1:4, :3] - sums[:, 1:4, 3:] * velocities[:, None]
    return -GRADIENT_SCALE * relative.diagonal(dim1=1, dim2=2).sum(dim=-1)


def pressure_velocity(pressure: Tensor, density_gradient: Tensor, graph: KernelGraph) -> Tensor:
    """Velocities (N, 3) that pressures (N,) remove: the particle's own, and its neighbors'. Momentum is conserved."""
    sums = kernel_sums(torch.cat([pressure[:, None], torch.zeros_like(density_gradient)], dim=-1), graph)
    return pressure[:, None] * density_gradient + GRADIENT_SCALE * sums[:, 1:4, 0]


def viscous_acceleration(velocities: Tensor, positions: Tensor, density: Tensor, graph: KernelGraph) -> Tensor:
    """Acceleration (N, 3) by viscosity, m/s².

    Laplacian of J. J. Monaghan, "Smoothed particle hydrodynamics", Reports on Progress in Physics 68, 2005. The
    reference divides by the neighbor's density; here it is the particle's own, since the neighbor's is not known yet.
    """
    neighbors = graph.neighbors
    displacement = positions.index_select(0, neighbors.senders) - positions.index_select(0, neighbors.receivers)
    relative = velocities.index_select(0, neighbors.senders) - velocities.index_select(0, neighbors.receivers)
    approach = (relative * graph.kernels[:, 1:]).sum(dim=-1) / density.index_select(0, neighbors.receivers)
    weight = approach / (displacement.square().sum(dim=-1) + VISCOSITY_SOFTENING * KERNEL_SUPPORT**2)
    sums = torch.zeros_like(velocities).index_add(0, neighbors.receivers, weight[:, None] * displacement)
    return LAPLACIAN_FACTOR * VISCOSITY * GRADIENT_SCALE * sums
