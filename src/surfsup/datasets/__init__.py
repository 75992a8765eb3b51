"""Data sets: recipes of scenes, their generation, and the windows of frames that training reads."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surfsup.datasets.generation.generate import generate

__all__ = ["generate"]


def __getattr__(name: str) -> object:
    """Import :func:`generate` when it is first used: most users of data sets do not make any."""
    if name == "generate":
        from surfsup.datasets.generation.generate import generate

        return generate
    raise AttributeError(f"module 'surfsup.datasets' has no attribute '{name}'")
