"""Particles that would pass through a solid, for Warp on a CPU; the same as ``native/sph/crossing.cpp``."""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.sdf import Surface
from surfsup.sph.clearance import CLEARANCE, LIPSCHITZ_BOUND, LastQuery

MAX_ADVANCES = 64  # of a particle along its path
CONTACT_FRACTION = 0.5  # of the clearance or the first distance, whichever is less: a path is cut there
MIN_SWEPT_PATH = 0.9  # of the clearance: a shorter path cannot lead through a solid
TOUCH = 0.05  # of the clearance: a path so near the solid leads into it


def stop_crossings(
    before: Tensor, positions: Tensor, surface: Surface, last: LastQuery | None
) -> tuple[Tensor, Tensor | None]:
    """Positions (N, 3), and which of them (K,) were put back to where their path enters the solid; None for none.

    A path is that from ``before`` (N, 3) to ``positions`` (N, 3). It is cut if it passes through the solid, or ends so
    deep in it that projection would move the particle out on the other side. Differentiable, but for the place of the
    cut.

    Args:
        before: positions one frame earlier.
        positions: now, in the container.
        surface: the solid.
        last: an earlier query of the solid.
    """
    with torch.no_grad():
        rows = possible_crossings(before, positions, last)
        rows, cut = crossings(before[rows], positions[rows], surface, rows)
        if len(rows) == 0:
            return positions, None
        parts = torch.ones_like(positions[:, :1]).index_copy(0, rows, cut[:, None])
    return torch.where(parts < 1, before + parts * (positions - before), positions), rows


def possible_crossings(before: Tensor, positions: Tensor, last: LastQuery | None) -> Tensor:
    """Particles (K,) whose path may lead through the solid."""
    path = torch.linalg.vector_norm(positions - before, dim=-1)
    possible = path > MIN_SWEPT_PATH * CLEARANCE
    if last is not None and bool(possible.any()):
        since = torch.linalg.vector_norm(before - last.positions, dim=-1)
        possible &= ~(LIPSCHITZ_BOUND * (since + path) < last.distance)
    return torch.nonzero(possible)[:, 0]


def entering(start: Tensor, end: Tensor, surface: Surface, touch: float) -> tuple[Tensor, Tensor]:
    """Which of the paths (K,) from ``start`` to ``end`` (K, 3) enter the solid, and the part of each up to it.

    Sphere tracing (J. C. Hart, "Sphere tracing", The Visual Computer 12, 1996). A path enters where it comes as near to
    the solid as ``touch`` in meters and as its contact. Those that begin inside are left out.
    """
    path = end - start
    length = torch.linalg.vector_norm(path, dim=-1)
    part, contact, cut = torch.zeros_like(length), torch.zeros_like(length), torch.full_like(length, -1.0)
    entered = torch.zeros_like(length, dtype=torch.bool)
    going = torch.arange(len(start))
    for advance in range(MAX_ADVANCES + 1):
        if len(going) == 0:
            break
        distance = surface.distance(start[going] + part[going, None] * path[going])
        if advance == 0:
            going, distance = going[distance > 0], distance[distance > 0]
            contact[going] = CONTACT_FRACTION * distance.clamp(max=CLEARANCE)
        near = distance <= contact[going]
        cut[going] = torch.where(near, torch.where(cut[going] < 0, part[going], cut[going]), -1.0)
        touches = distance <= contact[going].clamp(max=touch)
        if advance == MAX_ADVANCES:
            touches = torch.ones_like(touches)
        entered[going[touches]] = cut[going[touches]] >= 0
        part[going] += distance / LIPSCHITZ_BOUND / length[going]
        going = going[~touches & (part[going] < 1)]
    chosen = torch.nonzero(entered)[:, 0]
    return chosen, cut[chosen]


def crossings(start: Tensor, end: Tensor, surface: Surface, rows: Tensor) -> tuple[Tensor, Tensor]:
    """Which of particles ``rows`` (K,) pass through the solid, and the part of their path up to it."""
    chosen, cut = entering(start, end, surface, TOUCH * CLEARANCE)
    if len(chosen) == 0:
        return rows[chosen], cut
    start, end = start[chosen], end[chosen]
    _, at_entry = surface.distance_and_normal(start + cut[:, None] * (end - start))
    distance, at_end = surface.distance_and_normal(end)
    behind = (distance > CLEARANCE) | ((at_entry * at_end).sum(dim=-1) < 0)
    return rows[chosen[behind]], cut[behind]
