"""Walls that are too thin for particles: through them the water on one side interacts with that on the other.

Particles stay :data:`CLEARANCE` away from both sides of a wall. Where the rest of the kernel support is thicker than
the wall, neighbor search finds particles on the other side, whatever lies between.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from surfsup.scene.solids import Solids
from surfsup.scene.units import Units
from surfsup.sdf import Surface
from surfsup.sph.clearance import CLEARANCE
from surfsup.sph.kernels import KERNEL_SUPPORT

OPAQUE = KERNEL_SUPPORT - 2 * CLEARANCE  # meters, with particles of 15 mm: of a wall that hides the other side
SAMPLES = 256  # points of a solid whose wall is measured
SHARE = 0.02  # of them that must be thin
OPPOSITE = -0.7  # cosine between the normals of both sides of a wall; a sharp edge is no wall
PROJECTIONS, ADVANCES = 6, 60
NEAR = 1e-3  # of the solid's extent: a sample that ends so near the surface is on it
STEP = 1e-5  # of the solid's extent


class ThinWallWarning(UserWarning):
    """A wall is too thin for the particles."""


def thin_wall_warning(solids: Solids, units: Units) -> str | None:
    """One line on the walls of a scene that are too thin for its particles; None if there are none."""
    limit = OPAQUE * units.length
    named = [("the solid", solids.still), *((f"'{one.name}'", one.surface) for one in solids.moving)]
    for name, surface in named:
        thickness = None if surface is None else thin_wall(surface, limit)
        if thickness is None:
            continue
        radius = units.radius * thickness / limit
        remedy = f"particle_radius: {radius:.2g} avoids it" if radius >= 1e-3 else "only thicker walls avoid it"
        return (
            f"walls of {name} are {1000 * thickness:.2g} mm thick, particles {2000 * units.radius:.3g} mm: no water "
            f"passes, but through less than {1000 * limit:.3g} mm water interacts with that on the other side; {remedy}"
        )
    return None


@torch.no_grad()
def thin_wall(surface: Surface, limit: float) -> float | None:
    """The thickness of those walls of a solid that are thinner than ``limit``, in meters; None if hardly any are.

    Estimated at :data:`SAMPLES` points of the surface, from which rays lead inward; a small thin part may be missed.
    """
    lower, upper = surface.bounds().double().cpu()
    extent = float((upper - lower).max())
    if not 0 < extent < math.inf:
        return None
    generator = torch.Generator().manual_seed(0)
    points = (lower + (upper - lower) * torch.rand(SAMPLES, 3, generator=generator, dtype=torch.float64)).float()
    on_surface, normals = projected(surface, points, extent)
    thicknesses, through = depths(surface, on_surface, normals, limit, STEP * extent)
    if len(on_surface) == 0 or int(through.sum()) <= SHARE * len(on_surface):
        return None
    return float(thicknesses[through].median())


def projected(surface: Surface, points: Tensor, extent: float) -> tuple[Tensor, Tensor]:
    """Points (K, 3) of the surface near some of ``points`` (N, 3), and the normals (K, 3) there."""
    for _ in range(PROJECTIONS):
        distance, normal = surface.distance_and_normal(points)
        points = points - distance[:, None] * normal
    distance, normal = surface.distance_and_normal(points)
    fine = (distance.abs() < NEAR * extent) & torch.isfinite(points).all(dim=1) & (normal.norm(dim=1) > 0.5)
    points, normal = points[fine], normal[fine]
    return points - distance[fine][:, None] * normal, normal


def depths(surface: Surface, points: Tensor, normals: Tensor, limit: float, step: float) -> tuple[Tensor, Tensor]:
    """How far (K,) the solid reaches from ``points`` against their ``normals``, and whether a wall ends there.

    A wall ends at a side that faces the other way.
    """
    depth = torch.full((len(points),), step)
    inside = surface.distance(points - depth[:, None] * normals) < 0
    going = inside.nonzero()[:, 0]
    for _ in range(ADVANCES):
        distance = surface.distance(points[going] - depth[going, None] * normals[going])
        within = (distance < 0) & (depth[going] < limit)
        going, distance = going[within], distance[within]
        if len(going) == 0:
            break
        depth[going] = depth[going] - distance + step
    ends = points - depth[:, None] * normals
    distance, normal = surface.distance_and_normal(ends)
    opposite = (normal * normals).sum(dim=1) < OPPOSITE
    return depth, inside & (distance >= 0) & (depth < limit) & opposite
