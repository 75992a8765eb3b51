"""The substeps of a frame between all pairs of few particles, in torch: what the engine must compute."""

import torch
from torch import Tensor

from surfsup.sph import dfsph
from surfsup.sph.boundary.density import plane_fraction, solid_density
from surfsup.sph.boundary.walls import walls_density
from surfsup.sph.environment import Environment
from surfsup.sph.kernels import KERNEL_SUPPORT, cubic_spline, cubic_spline_gradient
from surfsup.sph.state import SUBSTEP_TIME, SUBSTEPS, ParticleState

VISCOSITY = dfsph.LAPLACIAN_FACTOR * dfsph.VISCOSITY * dfsph.GRADIENT_SCALE / KERNEL_SUPPORT


def boundary_density(
    positions: Tensor, predicted: Tensor, distance: Tensor, normal: Tensor, environment: Environment
) -> tuple[Tensor, Tensor]:
    """Density (N,) of solid and walls, and its gradient (N, 3), 1/m."""
    if environment.boundary_map is None:
        distance = distance + ((positions - predicted) * normal).sum(dim=-1)
        fraction = plane_fraction(distance)
    else:
        distance, fraction, normal = environment.boundary_map.query(positions)
    solid, slope = solid_density(distance, fraction)
    walls, walls_gradient = walls_density(positions, environment.lower, environment.upper)
    return solid + walls, walls_gradient - (slope / KERNEL_SUPPORT)[:, None] * normal


def advance(state: ParticleState, environment: Environment, distance: Tensor, normal: Tensor) -> tuple[Tensor, Tensor]:
    """Positions and velocities (N, 3) one frame later, by the pressure solve alone."""
    predicted, _ = state.ballistic(environment.gravity)
    middle = 0.5 * (state.positions + predicted).detach()
    pairs = (torch.cdist(middle, middle) <= KERNEL_SUPPORT) & ~torch.eye(len(middle), dtype=torch.bool)
    positions, velocities, gravity = state.positions, state.velocities, environment.gravity
    rest_density = torch.ones_like(distance)
    for number in range(SUBSTEPS):
        boundary, boundary_gradient = boundary_density(positions, predicted, distance, normal, environment)
        apart = torch.where(pairs[..., None], (positions - positions[:, None]) / KERNEL_SUPPORT, 2.0)
        q = torch.linalg.vector_norm(apart, dim=-1)
        kernel_gradient = (-0.5 * cubic_spline_gradient(q) / q)[..., None] * apart
        relative = velocities - velocities[:, None]
        approach = (relative * kernel_gradient).sum(dim=-1)
        density = dfsph.SELF_DENSITY * (1 + cubic_spline(q).sum(dim=1)) + boundary
        density_gradient = dfsph.GRADIENT_SCALE * kernel_gradient.sum(dim=1) + boundary_gradient
        if number == 0 and environment.boundary_map is None:
            rest_density = torch.where(distance < KERNEL_SUPPORT, density.clamp(min=1), 1.0)

        falling = velocities + number * SUBSTEP_TIME * gravity
        rate = -dfsph.GRADIENT_SCALE * approach.sum(dim=1) + (boundary_gradient * falling).sum(dim=-1)
        divergence_source = dfsph.DIVERGENCE_RELAXATION * rate.clamp(min=0)
        remaining = rate - divergence_source
        density_source = (
            (density - rest_density).clamp(max=dfsph.MAX_DENSITY_ERROR) / SUBSTEP_TIME
            + torch.nn.functional.softshrink(remaining, dfsph.DIVERGENCE_DEADBAND)
            + SUBSTEP_TIME * (boundary_gradient * gravity).sum(dim=-1)
        )
        squares = dfsph.GRADIENT_SCALE**2 * kernel_gradient.square().sum(dim=(1, 2))
        stiffness = density_gradient.square().sum(dim=-1) + squares
        source = divergence_source + dfsph.DENSITY_RELAXATION * density_source.clamp(min=0)
        pressure = torch.where(stiffness > dfsph.MIN_SQUARED_GRADIENT, source / stiffness.clamp(min=1e-9), 0.0)

        pushed = pressure[:, None] * density_gradient
        pushed = pushed + dfsph.GRADIENT_SCALE * (pressure[:, None] * kernel_gradient).sum(dim=1)
        weight = approach / (q.square() + dfsph.VISCOSITY_SOFTENING)
        viscous = VISCOSITY * (weight[..., None] * apart).sum(dim=1) / density[:, None]
        velocities = velocities + SUBSTEP_TIME * viscous - pushed
        positions = positions + SUBSTEP_TIME * (velocities + (number + 1) * SUBSTEP_TIME * gravity)
    return positions, velocities + SUBSTEPS * SUBSTEP_TIME * gravity
