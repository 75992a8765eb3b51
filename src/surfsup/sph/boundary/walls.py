"""What the container's walls add to the density of a particle near them, as the solver weighs it.

To the solver all walls are one solid: its share of the neighborhood is that of all of them, its nearest point is one.
It looks the distance up on cells of about 50 mm that end at the walls, in cubic polynomials that follow its edges
(:mod:`surfsup.sph.boundary.volume_map`). Within a cell of one wall that is the distance, of two it is x y / h instead of
the lesser of x and y, and of three x y z / h²: water meets round corners.
"""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.scene import WALL_CELL
from surfsup.sph.boundary.density import FARTHEST, flat_share, solid_density
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.state import Environment

CLOSEST = 1e-3  # meters: a particle closer to a wall, or in it, acts as if it were there


def walls_density(places: Tensor, environment: Environment) -> tuple[Tensor, Tensor]:
    """What the walls add to density (N,) at ``places`` (N, 3), in units of the lattice's, and its slope (N, 3), 1/m."""
    below, above = places - environment.lower, environment.upper - places
    distance = torch.minimum(below, above)
    towards = torch.where(below < above, -1.0, 1.0).to(places)
    # Were they independent, what one wall leaves of the neighborhood, the next would take its own share of: right to
    # 0.02 of the whole, at an edge.
    share = 1 - (1 - flat_share(distance)).prod(dim=-1)

    cell = cell_sizes(environment)
    part = (distance.clamp(min=CLOSEST) / cell).clamp(max=1)
    open_ = 1 - part
    near = open_.sum(dim=-1) > 0
    # Where the cells' sides differ, by a few hundredths, that of the nearest wall counts most.
    side = (open_ * cell).sum(dim=-1) / torch.where(near, open_.sum(dim=-1), 1.0)
    rounded = torch.where(near, part.prod(dim=-1) * side, FARTHEST)
    steepness = torch.where(part < 1, 1 / (part * cell), 0.0)
    normal = towards * torch.nn.functional.normalize(steepness, dim=-1)
    density, rise = solid_density(rounded, share)
    return density, (rise / KERNEL_SUPPORT)[:, None] * normal


def cell_sizes(environment: Environment) -> Tensor:
    """The sides (3,) of the cells that the solver looks the walls up in, meters."""
    size = environment.upper - environment.lower
    return size / (size / WALL_CELL).round().clamp(min=1)
