"""Density of the container's walls, as in the reference solver.

The reference treats all walls as one solid with one nearest point. It interpolates their distance in cells of about 50
mm by cubic shape functions (:mod:`surfsup.sph.boundary.volume_map`). Within a cell that is the distance to a single
wall, x y / c at an edge with cells of side c, instead of min(x, y), and x y z / c² in a corner: corners are rounded.
"""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.scene import WALL_CELL
from surfsup.sph.boundary.density import FRACTION_REACH, plane_fraction, solid_density
from surfsup.sph.kernels import KERNEL_SUPPORT

MIN_WALL_DISTANCE = 1e-3  # meters: closer particles, and those outside, are treated as at this distance


def walls_density(points: Tensor, lower: Tensor, upper: Tensor) -> tuple[Tensor, Tensor]:
    """Density (N,) of the walls at ``points`` (N, 3), relative to the rest density, and its gradient (N, 3), 1/m.

    Args:
        points: (N, 3), meters.
        lower, upper: (3,) corners of the container, meters.
    """
    below, above = points - lower, upper - points
    distance = torch.minimum(below, above)
    outward = torch.where(below < above, -1.0, 1.0).to(points)
    # The volume fraction for independent walls: accurate to 0.02 at an edge.
    fraction = 1 - (1 - plane_fraction(distance)).prod(dim=-1)

    cell = wall_cells(lower, upper)
    part = (distance.clamp(min=MIN_WALL_DISTANCE) / cell).clamp(max=1)
    open_part = 1 - part
    near = open_part.sum(dim=-1) > 0
    # The cells' sides differ by a few percent; the nearest wall's side has the largest weight.
    side = (open_part * cell).sum(dim=-1) / torch.where(near, open_part.sum(dim=-1), 1.0)
    rounded_distance = torch.where(near, part.prod(dim=-1) * side, FRACTION_REACH)
    steepness = torch.where(part < 1, 1 / (part * cell), 0.0)
    towards_wall = outward * torch.nn.functional.normalize(steepness, dim=-1)
    density, slope = solid_density(rounded_distance, fraction)
    return density, (slope / KERNEL_SUPPORT)[:, None] * towards_wall


def wall_cells(lower: Tensor, upper: Tensor) -> Tensor:
    """Sides (3,) of the cells in which the reference interpolates the walls, meters."""
    size = upper - lower
    return size / (size / WALL_CELL).round().clamp(min=1)
