"""The convolution's step, its parts for training, the search for neighbors, distances of solids and meshes, in C++.

It is built with the package where there is a compiler; torch does the same without it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surfsup.native._native import (
        Network,
        Solid,
        SolidMap,
        Triangles,
        convolve,
        convolve_back,
        energy_gain,
        find_pairs,
        guard,
        instruction_sets,
        sample,
        sum_fours,
        sum_fours_back,
    )
else:
    try:
        from surfsup.native._native import (
            Network,
            Solid,
            SolidMap,
            Triangles,
            convolve,
            convolve_back,
            energy_gain,
            find_pairs,
            guard,
            instruction_sets,
            sample,
            sum_fours,
            sum_fours_back,
        )
    except ImportError:  # the package was installed without a compiler
        Network = Solid = SolidMap = Triangles = None
        convolve = convolve_back = energy_gain = find_pairs = guard = None
        sample = sum_fours = sum_fours_back = None

        def instruction_sets() -> list[str]:
            """No instruction set: nothing is native."""
            return []


__all__ = [
    "Network",
    "Solid",
    "SolidMap",
    "Triangles",
    "convolve",
    "convolve_back",
    "energy_gain",
    "find_pairs",
    "guard",
    "instruction_sets",
    "sample",
    "sum_fours",
    "sum_fours_back",
]
