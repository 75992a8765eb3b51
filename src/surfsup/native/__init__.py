"""The convolution's step and the distances of solids in C++, built with the package where there is a compiler.

Torch does the same without it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surfsup.native._native import Network, Solid, paths
else:
    try:
        from surfsup.native._native import Network, Solid, paths
    except ImportError:  # the package was installed without a compiler
        Network = Solid = None

        def paths() -> list[str]:
            """No instruction set: nothing is native."""
            return []


__all__ = ["Network", "Solid", "paths"]
