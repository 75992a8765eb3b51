"""Sweeps: many scenes that differ in some values, simulated side by side."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surfsup.sweep.run import sweep

__all__ = ["sweep"]


def __getattr__(name: str) -> object:
    """Import :func:`sweep` when it is first used: it needs the whole simulator."""
    if name == "sweep":
        from surfsup.sweep.run import sweep

        return sweep
    raise AttributeError(f"module 'surfsup.sweep' has no attribute '{name}'")
