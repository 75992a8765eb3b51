"""The substeps of a frame by DFSPH: the method, its constants, and what a substep knows of the particles.

Bender and Koschier, "Divergence-Free SPH for Incompressible and Viscous Fluids", 2017. In each of its steps the
reference first removes the density rate from the velocities (divergence solve), then applies viscosity and gravity,
then removes the density error expected at the step's end (density solve). The divergence solve takes one iteration, the
density solve two to six (measured). Here a substep has one iteration for both: one pass over the neighbors gives both
pressures. All substeps of a frame use the neighbor list of the frame's middle. The substeps are written in C++
(``native/sph/dfsph_isa.hpp``) and in Warp (:mod:`surfsup.sph.warp_engine`).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from surfsup.scene import SPACING
from surfsup.sph.kernel_sums import KernelGraph, kernel_sums
from surfsup.sph.kernels import KERNEL_PEAK, KERNEL_SUPPORT

SELF_DENSITY = KERNEL_PEAK * SPACING**3  # of a lone particle, relative to the rest density
GRADIENT_SCALE = 2 * SELF_DENSITY / KERNEL_SUPPORT  # 1/m, from sums of kernel gradients to the density gradient

# Fractions of density rate and density error that a substep removes. The reference removes half in an iteration, and
# iterates the density solve at least twice. Slightly more than one such iteration suffices, and the water is calmer
# (measured).
DIVERGENCE_RELAXATION, DENSITY_RELAXATION = 0.5, 0.6
# 1/s. Density rates below this do not enter the predicted density error: in deep water their signs would alternate from
# substep to substep, and a pool would tremble (docs/log.md). In a splash their standard deviation is 1.4 to 9. Longer
# substeps have a wider deadband, in proportion.
DIVERGENCE_DEADBAND = 1.0
MIN_SQUARED_GRADIENT = 1e-5  # 1/m²: where density depends less on positions, pressure is zero
# m²/s, the reference's. Laplacian of J. J. Monaghan, "Smoothed particle hydrodynamics", Reports on Progress in Physics
# 68, 2005. The reference divides by the neighbor's density; here it is the particle's own, since the neighbor's is not
# known yet.
VISCOSITY = 0.01
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


def pressure_velocity(pressure: Tensor, density_gradient: Tensor, graph: KernelGraph) -> Tensor:
    """Velocities (N, 3) that pressures (N,) remove: the particle's own, and its neighbors'. Momentum is conserved."""
    sums = kernel_sums(torch.cat([pressure[:, None], torch.zeros_like(density_gradient)], dim=-1), graph)
    return pressure[:, None] * density_gradient + GRADIENT_SCALE * sums[:, 1:4, 0]
