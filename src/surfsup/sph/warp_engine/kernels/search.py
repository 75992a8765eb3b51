"""Neighbor search: particles into cells of a hash grid, and their neighbors from the cells around."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.warp_runtime import Precision

MAX_CELL = 2**20  # cells from the origin along an axis; particles beyond share the last cell


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
    def number_of(x: int, y: int, z: int, grid: wp.vec3i) -> int:
        # Rows along x, numbered modulo their number, and cells modulo the length of a row: any extent fits.
        return ((z * grid[2] + y) & (grid[1] - 1)) * grid[0] + (x & (grid[0] - 1))

    @wp.kernel(module=module, enable_backward=False)
    def assign_cells(
        positions: wp.array(dtype=vec3),
        predicted: wp.array(dtype=vec3),
        grid: wp.vec3i,
        cells: wp.array(dtype=int),
        order: wp.array(dtype=int),
        counts: wp.array(dtype=int),
        infinite: wp.array(dtype=int),
    ):
        i = wp.tid()
        middle = half * (positions[i] + predicted[i])
        cell = int(0)
        if wp.isfinite(middle):
            cell = number_of(coordinate(middle[0]), coordinate(middle[1]), coordinate(middle[2]), grid)
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
        grid: wp.vec3i,
        capacity: int,
        neighbors: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
        found_counts: wp.array(dtype=int),
    ):
        i = wp.tid()
        own = middles[i]
        x, y, z = coordinate(own[0]), coordinate(own[1]), coordinate(own[2])
        # The three cells of a row follow each other, unless they cross the row's end.
        inner = (x & (grid[0] - 1)) > 0 and (x & (grid[0] - 1)) < grid[0] - 1
        parts, width = int(3), int(1)
        if inner:
            parts, width = int(1), int(3)
        found = int(0)
        for row in range(9):
            for part in range(parts):
                first = number_of(x - 1 + part, y + row % 3 - 1, z + row // 3 - 1, grid)
                for j in range(starts[first], starts[first + width]):
                    if wp.length_sq(middles[j] - own) <= support * support and j != i:
                        if found < capacity:
                            neighbors[i, found] = j
                        found += 1
        counts[i] = wp.min(found, capacity)
        found_counts[i] = found

    @wp.kernel(module=module, enable_backward=False)
    def summarize_search(
        found_counts: wp.array(dtype=int),
        infinite: wp.array(dtype=int),
        parts: int,
        summary: wp.array(dtype=wp.int64),
    ):
        """Pairs, most neighbors of a particle, and whether a position is not finite. Integers add up in any order."""
        part = wp.tid()
        pairs, most = wp.int64(0), wp.int64(0)
        for i in range(part, found_counts.shape[0], parts):
            pairs += wp.int64(found_counts[i])
            most = wp.max(most, wp.int64(found_counts[i]))
        wp.atomic_add(summary, 0, pairs)
        wp.atomic_max(summary, 1, most)
        if part == 0:
            summary[2] = wp.int64(infinite[0])

    return SimpleNamespace(
        kernels=[assign_cells, sort_positions, list_neighbors, summarize_search],
        assign_cells=assign_cells,
        sort_positions=sort_positions,
        list_neighbors=list_neighbors,
        summarize_search=summarize_search,
    )
