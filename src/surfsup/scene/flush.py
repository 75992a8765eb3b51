"""Solids that the water touches.

Water keeps off a solid: the boundary volume map holds the first layer of particles two radii from the surface, so that
a solid displaces more than its volume (docs/physics.md). A solid that is ``flush`` enters the solver smaller by that
gap, and so displaces its own volume.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from surfsup.errors import InputError
from surfsup.scene.fluid import PARTICLE_RADIUS
from surfsup.scene.solids import MovingSolid, Solids, StillSolid, union_of
from surfsup.sdf import Surface
from surfsup.sdf.offset import Offset

GAP = 1.3 * PARTICLE_RADIUS  # meters, in the units of the solver: between a solid and the water (measured)
RESOLUTION = 48  # cells of marching cubes along the longest side
REACH = 2.0  # gaps from a corner of a box to that of the smaller one, and some to spare


def with_flush_solids(solids: Solids) -> Solids:
    """The solids as the solver has them, those that are flush smaller by the gap.

    Args:
        solids: in the units of the solver.

    Raises:
        InputError: a flush solid is too thin.
    """
    parts = tuple(shrunk(part) for part in solids.parts)
    moving = tuple(shrunk(solid) for solid in solids.moving)
    if all(new is old for new, old in zip((*parts, *moving), (*solids.parts, *solids.moving), strict=True)):
        return solids
    return replace(solids, still=union_of(parts), parts=parts, moving=moving)


Solid = TypeVar("Solid", StillSolid, MovingSolid)


def shrunk(solid: Solid) -> Solid:
    """A solid, smaller by the gap if it is flush."""
    if not solid.flush:
        return solid
    smaller = Offset(solid.surface, -GAP)
    check_thickness(solid.surface, smaller, solid.name)
    return replace(solid, surface=smaller)


def check_thickness(surface: Surface, smaller: Surface, name: str) -> None:
    """Refuse a solid of which some part vanishes when it shrinks.

    Raises:
        InputError: with the least thickness that is possible.
    """
    from scipy.spatial import cKDTree

    message = (
        f"surface '{name}' is flush, but thinner than {2 * GAP / PARTICLE_RADIUS:.2g} particle radii in places, where "
        "the water would pass through; make it thicker, use smaller particles, or set flush: false"
    )
    try:
        inner = np.asarray(smaller.to_mesh(RESOLUTION).vertices)
    except InputError:
        raise InputError(message) from None
    outer = surface.to_mesh(RESOLUTION)
    cell = float(np.ptp(inner, axis=0).max()) / RESOLUTION
    points = np.concatenate([np.asarray(outer.vertices), np.asarray(outer.triangles_center)])
    if np.max(cKDTree(inner).query(points)[0]) > REACH * GAP + 2 * cell:
        raise InputError(message)
