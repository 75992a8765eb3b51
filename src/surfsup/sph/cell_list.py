"""Neighbor search by a sorted cell list in torch, for GPUs.

Green, "Particle Simulation using CUDA", 2010.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from surfsup.sph.stability import check_pairs, max_pairs, not_finite

MAX_CELL = 2**19  # cells from the middle along an axis; particles beyond share the last cell
# Particles whose candidates are held at the same time: about 200 candidates each in water, about 100 bytes per
# candidate.
CHUNK = 2**18
CELLS_TO_BALL = 27 / (4 / 3 * math.pi)  # volume of the 27 cells around a particle over that of the ball


def pairs_by_cells(positions: Tensor, radius: float, chunk: int = CHUNK) -> tuple[Tensor, Tensor]:
    """Receivers (E,) and senders (E,) of all ordered pairs of ``positions`` (N, 3) within ``radius`` meters.

    Ordered by receiver, then by sender. The host synchronizes once, and twice per ``chunk`` particles: for the
    numbers of candidates and of pairs.

    Raises:
        SimulationError: a position is not finite, or the particles have collapsed into a clump.
    """
    if len(positions) == 0:
        return (torch.zeros(0, dtype=torch.long, device=positions.device),) * 2
    points = positions.detach().double()  # as on the CPU, so that ties are broken the same way
    if not bool(points.isfinite().all()):
        raise not_finite()
    middle = points.median(dim=0).values
    cells = ((points - middle) / radius).floor().clamp(-MAX_CELL, MAX_CELL).long() + MAX_CELL + 1
    side = 2 * MAX_CELL + 3
    keys, order = ((cells[:, 0] * side + cells[:, 1]) * side + cells[:, 2]).sort()
    sorted_points = points[order]
    found = [
        pairs_of(
            torch.arange(first, min(first + chunk, len(keys)), device=keys.device), keys, side, sorted_points, radius
        )
        for first in range(0, len(keys), chunk)
    ]
    receivers, senders = (order[torch.cat(part)] for part in zip(*found, strict=True))
    pairs = (receivers * len(points) + senders).sort().values
    return pairs // len(points), pairs % len(points)


def pairs_of(receivers: Tensor, keys: Tensor, side: int, points: Tensor, radius: float) -> tuple[Tensor, Tensor]:
    """Receivers and senders of all pairs with the given receivers, unordered.

    Args:
        receivers: indices of sorted particles.
        keys: (N,) cell keys of the sorted particles, ascending.
        side: difference of the keys of two cells next to each other along y.
        points: (N, 3) sorted positions, meters.
        radius: meters.

    Raises:
        SimulationError: there are too many candidates to hold, as in a clump.
    """
    # Three cells in a row along z have consecutive keys: nine ranges hold all candidates.
    offsets = torch.arange(-1, 2, device=keys.device)
    rows = keys[receivers][:, None] + ((offsets[:, None] * side + offsets) * side).flatten()
    first = torch.searchsorted(keys, rows - 1)
    count = (torch.searchsorted(keys, rows + 1, right=True) - first).flatten()
    total = int(count.sum())
    if total > CELLS_TO_BALL * max_pairs(CHUNK, radius):
        check_pairs(total, len(receivers), radius)
    ranges = torch.repeat_interleave(count, output_size=total)
    before = count.cumsum(0) - count
    senders = first.flatten()[ranges] + torch.arange(total, device=keys.device) - before[ranges]
    repeated = receivers[ranges // rows.shape[1]]
    near = (points[repeated] - points[senders]).square().sum(dim=-1) <= radius**2
    kept = (near & (repeated != senders)).nonzero()[:, 0]
    return repeated[kept], senders[kept]
