"""Neighbours where the particles are, on a GPU too: a cell list by sorting.

Green, "Particle Simulation using CUDA", 2010.
"""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.errors import SimulationError

FARTHEST_CELL = 2**19  # cells from the middle; what has flown farther shares the last one


def pairs_by_cells(positions: Tensor, radius: float) -> tuple[Tensor, Tensor]:
    """Receivers (E,) and senders (E,) of all ordered pairs of ``positions`` (N, 3) nearer than ``radius``.

    Ordered by receiver, then by sender. The host waits twice: for the number of candidates and for that of pairs.

    Raises:
        SimulationError: a position is not finite.
    """
    places = positions.detach().double()  # as in the search on the CPU: a tie must not fall the other way
    middle = places.median(dim=0).values
    cells = ((places - middle) / radius).floor().clamp(-FARTHEST_CELL, FARTHEST_CELL).long() + FARTHEST_CELL + 1
    side = 2 * FARTHEST_CELL + 3
    keys, by_cell = ((cells[:, 0] * side + cells[:, 1]) * side + cells[:, 2]).sort()
    # Three cells in a row along z have keys in a row, so nine ranges hold all that can be near.
    around = torch.arange(-1, 2, device=keys.device)
    rows = keys[:, None] + ((around[:, None] * side + around) * side).flatten()
    first = torch.searchsorted(keys, rows - 1)
    count = torch.searchsorted(keys, rows + 1, right=True) - first
    total = torch.where(places.isfinite().all(), count.sum(), -1).item()
    if total < 0:
        raise SimulationError("the simulation blew up: a particle's position is not a finite number")
    ranges = torch.repeat_interleave(count.flatten(), output_size=total)
    before = count.flatten().cumsum(0) - count.flatten()
    sender = first.flatten()[ranges] + torch.arange(total, device=keys.device) - before[ranges]
    receiver = ranges // rows.shape[1]
    receivers, senders = by_cell[receiver], by_cell[sender]
    near = (places[receivers] - places[senders]).square().sum(dim=-1) <= radius**2
    pairs = (receivers * len(places) + senders)[near & (receivers != senders)].sort().values
    return pairs // len(places), pairs % len(places)
