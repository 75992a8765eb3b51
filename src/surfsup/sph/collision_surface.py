"""The solid as collision handling queries it."""

from __future__ import annotations

from surfsup.native.dispatch import tensors_requiring_grad
from surfsup.sdf import Surface
from surfsup.sdf.edges import with_edges
from surfsup.sdf.openings import with_openings
from surfsup.sph.clearance import CLEARANCE

REACH = 1.25 * CLEARANCE  # meters: a bound beyond that moves no particle


def for_collisions(surface: Surface) -> Surface:
    """``surface`` with the distance beside its edges and, unless its shape has gradients, in its openings."""
    edged = with_edges(surface)
    return edged if tensors_requiring_grad(surface) else with_openings(edged, REACH)
