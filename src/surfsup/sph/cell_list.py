"""Neighbors where the particles are, on a GPU too: a cell list by sorting.

Green, "Particle Simulation using CUDA", 2010.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from surfsup.sph.stability import blown_up, collapsed, max_edges

FARTHEST_CELL = 2**19  # cells from the middle; what has flown farther shares the last one
# Particles for whom what may be near is held at once: some 200 each in water, about a hundred bytes for each of these.
AT_ONCE = 2**18
CELLS_TO_BALL = 27 / (4 / 3 * math.pi)  # the volume of all cells around one to that of the radius around a particle


def pairs_by_cells(positions: Tensor, radius: float, at_once: int = AT_ONCE) -> tuple[Tensor, Tensor]:
    """Receivers (E,) and senders (E,) of all ordered pairs of ``positions`` (N, 3) nearer than ``radius``.

    Ordered by receiver, then by sender. The host waits once, and twice for every ``at_once`` particles: for the number
    of candidates and for that of pairs.

    Raises:
        SimulationError: a position is not finite, or the particles have collapsed into a clump.
    """
    if len(positions) == 0:
        return (torch.zeros(0, dtype=torch.long, device=positions.device),) * 2
    places = positions.detach().double()  # as in the search on the CPU: a tie must not fall the other way
    if not bool(places.isfinite().all()):
        raise blown_up()
    middle = places.median(dim=0).values
    cells = ((places - middle) / radius).floor().clamp(-FARTHEST_CELL, FARTHEST_CELL).long() + FARTHEST_CELL + 1
    side = 2 * FARTHEST_CELL + 3
    keys, by_cell = ((cells[:, 0] * side + cells[:, 1]) * side + cells[:, 2]).sort()
    sorted_places = places[by_cell]
    found = [
        pairs_of(
            torch.arange(first, min(first + at_once, len(keys)), device=keys.device), keys, side, sorted_places, radius
        )
        for first in range(0, len(keys), at_once)
    ]
    receivers, senders = (by_cell[torch.cat(part)] for part in zip(*found, strict=True))
    pairs = (receivers * len(places) + senders).sort().values
    return pairs // len(places), pairs % len(places)


def pairs_of(some: Tensor, keys: Tensor, side: int, places: Tensor, radius: float) -> tuple[Tensor, Tensor]:
    """Receivers and senders of all pairs of which ``some`` particles are the receivers, in no order.

    Args:
        some: which, as all are counted here: by their cells.
        keys: (N,) of the particles' cells, ascending.
        side: from a cell's key to that of the next one along y.
        places: (N, 3) of the particles, meters.
        radius: meters.

    Raises:
        SimulationError: what may be near is more than memory can be asked for, as in a clump.
    """
    # Three cells in a row along z have keys in a row, so nine ranges hold all that can be near.
    around = torch.arange(-1, 2, device=keys.device)
    rows = keys[some][:, None] + ((around[:, None] * side + around) * side).flatten()
    first = torch.searchsorted(keys, rows - 1)
    count = (torch.searchsorted(keys, rows + 1, right=True) - first).flatten()
    total = int(count.sum())
    if total > CELLS_TO_BALL * max_edges(AT_ONCE, radius):
        raise collapsed(radius)
    ranges = torch.repeat_interleave(count, output_size=total)
    before = count.cumsum(0) - count
    senders = first.flatten()[ranges] + torch.arange(total, device=keys.device) - before[ranges]
    receivers = some[ranges // rows.shape[1]]
    near = (places[receivers] - places[senders]).square().sum(dim=-1) <= radius**2
    at = (near & (receivers != senders)).nonzero()[:, 0]
    return receivers[at], senders[at]
