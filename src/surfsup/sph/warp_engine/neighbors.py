"""Neighbor search in Warp: particles sorted by cell, and for each a list of its neighbors.

Green, "Particle Simulation using CUDA", 2010.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
import warp as wp

from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.stability import check_pairs
from surfsup.sph.warp_engine import runtime
from surfsup.sph.warp_engine.kernels.search import search_kernels
from surfsup.sph.warp_engine.runtime import Precision

SMALL_GRID, LARGE_GRID = 32, 128  # cells along each side of the hash grid; powers of two
LARGE_COUNT = 500_000  # particles from which the large grid is used
CAPACITY = 64  # neighbors of a particle for which there is room at first; water has 34


@dataclass(frozen=True)
class NeighborTable:
    """The neighbors within the kernel support of particles that are sorted by cell.

    Attributes:
        order: (N,) int32, the caller's index of each sorted particle.
        neighbors: (N, capacity) int32, sorted indices.
        counts: (N,) int32, how many of them there are.
    """

    order: wp.array
    neighbors: wp.array
    counts: wp.array

    def __len__(self) -> int:
        """The number of particles."""
        return len(self.order)


def find_neighbor_table(positions: wp.array, predicted: wp.array, precision: Precision) -> NeighborTable:
    """The neighbors of particles halfway between ``positions`` and ``predicted`` (N, 3).

    The list has room for ``CAPACITY`` neighbors of a particle. Where some particle has more, the search is repeated
    with more room.

    Raises:
        SimulationError: a position is not finite, or the particles have collapsed into a clump.
    """
    kernels, device, count = search_kernels(precision), positions.device, len(positions)
    if count == 0:
        none = wp.empty(0, dtype=int, device=device)
        return NeighborTable(none, empty_table(0, CAPACITY, int, device), none)
    side = SMALL_GRID if count < LARGE_COUNT else LARGE_GRID
    cells, order = (wp.empty(2 * count, dtype=int, device=device) for _ in range(2))  # the sort needs twice the room
    starts = wp.zeros(side**3 + 1, dtype=int, device=device)
    infinite = wp.zeros(1, dtype=int, device=device)
    wp.launch(
        kernels.assign_cells, count, [positions, predicted, side], [cells, order, starts, infinite], device=device
    )
    wp.utils.radix_sort_pairs(cells, order, count)
    wp.utils.array_scan(starts, starts, inclusive=False)
    order = order[:count]
    middles = wp.empty(count, dtype=precision.vec3, device=device)
    wp.launch(kernels.sort_positions, count, [positions, predicted, order], [middles], device=device)
    counts = wp.empty(count, dtype=int, device=device)
    capacity = CAPACITY
    while True:
        neighbors = empty_table(count, capacity, int, device)
        wp.launch(kernels.list_neighbors, count, [middles, starts, side, capacity], [neighbors, counts], device=device)
        found = runtime.to_torch(counts)
        pairs, most, unusable = torch.stack([found.sum(), found.amax(), runtime.to_torch(infinite)[0]]).cpu().tolist()
        check_pairs(-1 if unusable else pairs, count, KERNEL_SUPPORT)
        if most <= capacity:
            return NeighborTable(order, neighbors, counts)
        capacity = most


def empty_table(count: int, capacity: int, dtype: Any, device: Any) -> wp.array:
    """An array (count, capacity), by rows on a CPU and by columns on a GPU, as each reads it fastest."""
    if device.is_cpu:
        return wp.empty((count, capacity), dtype=dtype, device=device)
    return wp.empty((capacity, count), dtype=dtype, device=device).transpose()
