"""The C++ code: DFSPH solver, neighbor search, signed distances, graph networks.

It is built with the package where there is a compiler. Without it Warp and torch compute the same;
:mod:`surfsup.native.dispatch` decides.
"""

from __future__ import annotations

try:
    from surfsup.native._native import (
        BoundaryMap,
        BoundaryParameters,
        CollisionParameters,
        LiquidParameters,
        Solid,
        Solver,
        SolverParameters,
        TriangleBvh,
        convolve,
        convolve_gradient,
        edges_backward,
        edges_forward,
        energy_gain,
        find_neighbor_pairs,
        has_bfloat16,
        instruction_sets,
        interpolate_grid,
        limit_energy_gain,
        resolve_collisions,
        resolve_moving_collisions,
        rows_backward,
        rows_forward,
        sum_kernels,
        sum_kernels_gradient,
    )
except ImportError:  # the package was installed without a compiler

    def instruction_sets() -> list[str]:
        """No instruction set: the other names of this module do not exist."""
        return []


__all__ = [
    "BoundaryMap",
    "BoundaryParameters",
    "CollisionParameters",
    "LiquidParameters",
    "Solid",
    "Solver",
    "SolverParameters",
    "TriangleBvh",
    "convolve",
    "convolve_gradient",
    "edges_backward",
    "edges_forward",
    "energy_gain",
    "find_neighbor_pairs",
    "has_bfloat16",
    "instruction_sets",
    "interpolate_grid",
    "limit_energy_gain",
    "resolve_collisions",
    "resolve_moving_collisions",
    "rows_backward",
    "rows_forward",
    "sum_kernels",
    "sum_kernels_gradient",
]
