"""What an objective asks of the density of a predicted frame."""

from __future__ import annotations

from torch import Tensor

from surfsup.scene import SPACING
from surfsup.sph.boundary.density import flat_share, solid_density
from surfsup.sph.boundary.walls import walls_density
from surfsup.sph.kernels import KERNEL_PEAK, KERNEL_SUPPORT, cubic_spline
from surfsup.sph.neighbor_search import NeighborList
from surfsup.sph.state import Environment

SQUEEZED = 0.03  # of the lattice's density: some of what a frame's correction can change


def density_loss(positions: Tensor, near: NeighborList, distance: Tensor, environment: Environment) -> Tensor:
    """How far the fluid is squeezed beyond the density that the solver never lets it exceed.

    The solver's pressure holds every particle at or below the lattice's density, in every frame (measured: 1.000 is
    the highest far from solids, 1.04 near them, where they are taken for flat). A model that is nearly right in each
    frame drifts above that in hundreds, and nothing in a single frame's error tells it so.

    Args:
        positions: (N, 3) predicted, meters.
        near: at least all pairs within the kernel's support, for positions about these.
        distance: (N,) of the positions from the solid, meters.
        environment: container.
    """
    apart = positions.index_select(0, near.senders) - positions.index_select(0, near.receivers)
    density = lattice_density(apart.square().sum(dim=-1), near)
    density = density + solid_density(distance, flat_share(distance))[0] + walls_density(positions, environment)[0]
    return ((density - 1).clamp(min=0) / SQUEEZED).square().mean()


def lattice_density(squared: Tensor, near: NeighborList) -> Tensor:
    """The density (N,) in units of the lattice's, from the squared distances (E,) of neighbors in m².

    The solver's cubic spline kernel, as in :func:`surfsup.datasets.density.number_density`.
    """
    # The root has no slope at zero, where two particles lie on top of each other.
    q = (squared / KERNEL_SUPPORT**2).clamp(min=1e-8).sqrt()
    own = squared.new_ones(len(near.starts) - 1)
    return own.index_add(0, near.receivers, cubic_spline(q)) * (KERNEL_PEAK * SPACING**3)
