"""Neighbor search in Warp: particles sorted by cell, and for each a list of its neighbors.

Green, "Particle Simulation using CUDA", 2010.
"""

from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any

import torch
import warp as wp

from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.stability import check_pairs
from surfsup.sph.warp_engine.runtime import Precision

SMALL_GRID, LARGE_GRID = 32, 128  # cells along each side of the hash grid; powers of two
LARGE_COUNT = 500_000  # particles from which the large grid is used
CAPACITY = 64  # neighbors of a particle for which there is room at first; water has 34
MAX_CELL = 2**20  # cells from the origin along an axis; particles farther away share the last cell


@cache
def search_kernels(precision: Precision) -> SimpleNamespace:
    """The kernels of the neighbor search in a precision."""
    real, vec3 = precision.real, precision.vec3
    module = f"surfsup.neighbors.{precision.name}"
    support = real(KERNEL_SUPPORT)
    limit = real(MAX_CELL)
    half = real(0.5)

    @wp.func
    def coordinate(x: real) -> int:
        return int(wp.floor(wp.clamp(x / support, -limit, limit)))

    @wp.func
    def number_of(x: int, y: int, z: int, side: int) -> int:
        # Cell coordinates are taken modulo the side, so that any extent fits.
        mask = side - 1
        return ((z & mask) * side + (y & mask)) * side + (x & mask)

    @wp.kernel(module=module, enable_backward=False)
    def assign_cells(
        positions: wp.array(dtype=vec3),
        predicted: wp.array(dtype=vec3),
        side: int,
        cells: wp.array(dtype=int),
        order: wp.array(dtype=int),
        counts: wp.array(dtype=int),
        infinite: wp.array(dtype=int),
    ):
        i = wp.tid()
        middle = half * (positions[i] + predicted[i])
        cell = int(0)
        if wp.isfinite(middle):
            cell = number_of(coordinate(middle[0]), coordinate(middle[1]), coordinate(middle[2]), side)
        else:
            infinite[0] = 1
        cells[i] = cell
        order[i] = i
        wp.atomic_add(counts, cell, 1)

    @wp.kernel(module=module, enable_backward=False)
    def sort_positions(
        positions: wp.array(dtype=vec3),
        predicted: wp.array(dtype=vec3),
        order: wp.array(dtype=int),
        middles: wp.array(dtype=vec3),
    ):
        i = wp.tid()
        k = order[i]
        middles[i] = half * (positions[k] + predicted[k])

    @wp.kernel(module=module, enable_backward=False)
    def list_neighbors(
        middles: wp.array(dtype=vec3),
        starts: wp.array(dtype=int),
        side: int,
        capacity: int,
        neighbors: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
    ):
        i = wp.tid()
        own = middles[i]
        x, y, z = coordinate(own[0]), coordinate(own[1]), coordinate(own[2])
        # The three cells of a row follow each other, unless the row crosses the grid's border.
        inner = (x & (side - 1)) > 0 and (x & (side - 1)) < side - 1
        parts, width = int(3), int(1)
        if inner:
            parts, width = int(1), int(3)
        found = int(0)
        for row in range(9):
            for part in range(parts):
                first = number_of(x - 1 + part, y + row % 3 - 1, z + row // 3 - 1, side)
                for j in range(starts[first], starts[first + width]):
                    if wp.length_sq(middles[j] - own) <= support * support and j != i:
                        if found < capacity:
                            neighbors[i, found] = j
                        found += 1
        counts[i] = found

    return SimpleNamespace(
        kernels=[assign_cells, sort_positions, list_neighbors],
        assign_cells=assign_cells,
        sort_positions=sort_positions,
        list_neighbors=list_neighbors,
    )


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
        wp.launch(
            kernels.list_neighbors, count, [middles, starts, side, capacity], [neighbors, counts], device=device
        )
        found = wp.to_torch(counts)
        pairs, most, unusable = torch.stack([found.sum(), found.amax(), wp.to_torch(infinite)[0]]).tolist()
        check_pairs(-1 if unusable else pairs, count, KERNEL_SUPPORT)
        if most <= capacity:
            return NeighborTable(order, neighbors, counts)
        capacity = most


def empty_table(count: int, capacity: int, dtype: Any, device: Any) -> wp.array:
    """An array (count, capacity), by rows on a CPU and by columns on a GPU, as each reads it fastest."""
    if device.is_cpu:
        return wp.empty((count, capacity), dtype=dtype, device=device)
    return wp.empty((capacity, count), dtype=dtype, device=device).transpose()
