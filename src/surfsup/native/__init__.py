"""The C++ code: DFSPH solver, neighbor search, signed distances, graph networks.

It is built with the package where there is a compiler. Without it Warp and torch compute the same;
:mod:`surfsup.native.dispatch` decides. In the environment ``SURFSUP_NATIVE=0`` hides the C++ code, and
``SURFSUP_NATIVE=FILE`` loads another build of it, such as that of ``scripts/sanitize-native``.
"""

from __future__ import annotations

import os
import sys
from importlib.machinery import ExtensionFileLoader, ModuleSpec
from importlib.util import module_from_spec

_BUILD = os.environ.get("SURFSUP_NATIVE", "")
if _BUILD not in ("", "0"):
    _LOADER = ExtensionFileLoader(f"{__name__}._native", _BUILD)
    _MODULE = module_from_spec(ModuleSpec(_LOADER.name, _LOADER, origin=_BUILD))
    _LOADER.exec_module(_MODULE)
    sys.modules[_LOADER.name] = _MODULE

try:
    if _BUILD == "0":
        raise ImportError("hidden by SURFSUP_NATIVE=0")
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
