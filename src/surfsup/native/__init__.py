"""The convolution's step in C++, built with the package where there is a compiler; torch does the same without it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surfsup.native._native import Network, paths
else:
    try:
        from surfsup.native._native import Network, paths
    except ImportError:  # the package was installed without a compiler
        Network = None

        def paths() -> list[str]:
            """No instruction set: there is no native step."""
            return []


__all__ = ["Network", "paths"]
