"""Neighbor search in Warp: particles sorted by cell, and for each a list of its neighbors.

Green, "Particle Simulation using CUDA", 2010.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from surfsup import warp_runtime as runtime
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.stability import check_pairs
from surfsup.sph.warp_engine.kernels.search import search_kernels
from surfsup.warp_runtime import Precision

# Cells in a row along x, rows, and rows from one layer to the next. The first two are powers of two.
SMALL_GRID, LARGE_GRID = (32, 1024, 32), (256, 16384, 641)
LARGE_COUNT = 500_000  # particles from which the large grid is used
CAPACITY = 64  # neighbors of a particle for which there is room at first; water has 34
PARTS = 4096  # threads that sum up the search


class NeighborSearch:
    """The neighbors within the kernel support of particles that are sorted by cell, in arrays that stay on the device.

    A particle with more than ``capacity`` neighbors loses the others; :meth:`check` finds out.

    Args:
        count: number of particles.
        capacity: neighbors of a particle for which there is room.
        precision: of the positions.
        device: Warp's.

    Attributes:
        order: (N,) int32, the caller's index of each sorted particle.
        neighbors: (N, capacity) int32, sorted indices.
        counts: (N,) int32, how many of them there are.
        summary: (3,) int64: neighbor pairs, most neighbors of a particle, whether a position is not finite.
    """

    def __init__(self, count: int, capacity: int, precision: Precision, device: Any) -> None:
        self.count, self.capacity, self.kernels, self.device = count, capacity, search_kernels(precision), device
        cells_in_row, rows, layer = SMALL_GRID if count < LARGE_COUNT else LARGE_GRID
        self.grid = wp.vec3i(cells_in_row, rows, layer)
        # The sort needs twice the room.
        self.cells, self.sorted = (wp.empty(2 * count, dtype=int, device=device) for _ in range(2))
        self.order = self.sorted[:count] if count else self.sorted
        self.starts = wp.empty(cells_in_row * rows + 1, dtype=int, device=device)
        self.infinite = wp.empty(1, dtype=int, device=device)
        self.middles = wp.empty(count, dtype=precision.vec3, device=device)
        self.neighbors = empty_table(count, capacity, int, device)
        self.counts, self.found = (wp.empty(count, dtype=int, device=device) for _ in range(2))
        self.summary = wp.empty(3, dtype=wp.int64, device=device)

    def run(self, positions: wp.array, predicted: wp.array) -> None:
        """Find the neighbors of particles halfway between ``positions`` and ``predicted`` (N, 3)."""
        kernels, count = self.kernels, self.count
        for array in (self.starts, self.infinite, self.summary):
            array.zero_()
        self._launch(
            kernels.assign_cells,
            count,
            [positions, predicted, self.grid],
            [self.cells, self.sorted, self.starts, self.infinite],
        )
        wp.utils.radix_sort_pairs(self.cells, self.sorted, count)
        wp.utils.array_scan(self.starts, self.starts, inclusive=False)
        self._launch(kernels.sort_positions, count, [positions, predicted, self.order], [self.middles])
        self._launch(
            kernels.list_neighbors,
            count,
            [self.middles, self.starts, self.grid, self.capacity],
            [self.neighbors, self.counts, self.found],
        )
        parts = min(count, PARTS)
        self._launch(kernels.summarize_search, parts, [self.found, self.infinite, parts], [self.summary])

    def check(self) -> int:
        """The capacity that the last search needed; more than there is if it must be repeated. Waits for the device.

        Raises:
            SimulationError: a position is not finite, or the particles have collapsed into a clump.
        """
        pairs, most, infinite = runtime.to_torch(self.summary).cpu().tolist()
        check_pairs(-1 if infinite else pairs, self.count, KERNEL_SUPPORT)
        return max(most, self.capacity)

    def _launch(self, kernel: wp.Kernel, threads: int, inputs: list[Any], outputs: list[Any]) -> None:
        wp.launch(kernel, threads, inputs, outputs, device=self.device)


def empty_table(count: int, capacity: int, dtype: Any, device: Any) -> wp.array:
    """An array (count, capacity), by rows on a CPU and by columns on a GPU, as each reads it fastest."""
    if device.is_cpu:
        return wp.empty((count, capacity), dtype=dtype, device=device)
    return wp.empty((capacity, count), dtype=dtype, device=device).transpose()
