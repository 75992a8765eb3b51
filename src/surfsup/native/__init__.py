"""The convolution's step, its parts for training, the search for neighbours, distances of solids and meshes, in C++.

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
        contain,
        convolve,
        convolve_back,
        energy_gain,
        find_pairs,
        paths,
        push,
        sample,
        sum_fours,
        sum_fours_back,
        within_reach,
    )
else:
    try:
        from surfsup.native._native import (
            Network,
            Solid,
            SolidMap,
            Triangles,
            contain,
            convolve,
            convolve_back,
            energy_gain,
            find_pairs,
            paths,
            push,
            sample,
            sum_fours,
            sum_fours_back,
            within_reach,
        )
    except ImportError:  # the package was installed without a compiler
        Network = Solid = SolidMap = Triangles = None
        contain = convolve = convolve_back = energy_gain = find_pairs = push = None
        sample = sum_fours = sum_fours_back = within_reach = None

        def paths() -> list[str]:
            """No instruction set: nothing is native."""
            return []


__all__ = [
    "Network",
    "Solid",
    "SolidMap",
    "Triangles",
    "contain",
    "convolve",
    "convolve_back",
    "energy_gain",
    "find_pairs",
    "paths",
    "push",
    "sample",
    "sum_fours",
    "sum_fours_back",
    "within_reach",
]
