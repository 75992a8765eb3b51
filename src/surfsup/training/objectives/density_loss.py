"""The density term of an objective: a penalty on compression."""

from __future__ import annotations

from torch import Tensor

from surfsup.scene import SPACING
from surfsup.sph.boundary.density import plane_fraction, solid_density
from surfsup.sph.boundary.walls import walls_density
from surfsup.sph.environment import Environment
from surfsup.sph.kernels import KERNEL_PEAK, KERNEL_SUPPORT, cubic_spline
from surfsup.sph.neighbor_search import NeighborList

COMPRESSION_SCALE = 0.03  # of the rest density: part of what the prediction of one frame can change


def density_loss(positions: Tensor, neighbors: NeighborList, distance: Tensor, environment: Environment) -> Tensor:
    """The mean squared compression above the rest density, in units of COMPRESSION_SCALE.

    The reference solver holds the density of every particle at or below the rest density in every frame (measured: at
    most 1.000 far from surfaces and 1.04 near them, where this loss takes the surface for flat). A model that is nearly
    right in each frame exceeds it after hundreds, which the error of a single frame does not show.

    Args:
        positions: (N, 3) predicted, meters.
        neighbors: at least all pairs within the kernel support, for positions near these.
        distance: (N,) signed distance of the positions to the surface, meters.
        environment: the container.
    """
    offsets = positions.index_select(0, neighbors.senders) - positions.index_select(0, neighbors.receivers)
    walls, _ = walls_density(positions, environment.lower, environment.upper)
    solid, _ = solid_density(distance, plane_fraction(distance))
    density = fluid_density(offsets.square().sum(dim=-1), neighbors) + solid + walls
    return ((density - 1).clamp(min=0) / COMPRESSION_SCALE).square().mean()


def fluid_density(squared_distances: Tensor, neighbors: NeighborList) -> Tensor:
    """The density (N,) of the fluid in units of the rest density, by the cubic spline kernel.

    Equals :func:`surfsup.datasets.density.number_density`, with gradients.

    Args:
        squared_distances: (E,) of the neighbor pairs, m².
        neighbors: the pairs.
    """
    # The square root has no gradient at zero, where two particles coincide.
    q = (squared_distances / KERNEL_SUPPORT**2).clamp(min=1e-8).sqrt()
    own = squared_distances.new_ones(len(neighbors.starts) - 1)
    return own.index_add(0, neighbors.receivers, cubic_spline(q)) * (KERNEL_PEAK * SPACING**3)
