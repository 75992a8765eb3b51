"""Solids at latent codes between two shapes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from surfsup.errors import InputError
from surfsup.sdf.marching_cubes import polygonize
from surfsup.sdf.neural.deepsdf import DeepSdf

if TYPE_CHECKING:
    import trimesh

RESOLUTION = 96  # cells along the cube


@dataclass(frozen=True)
class InterpolatedSolid:
    """The solid of an interpolated code.

    Attributes:
        fraction: 0 at the first code, 1 at the second.
        mesh: in the cube of side 2; None where the code has no inside.
        parts: number of connected parts of the mesh.
        closed: whether the mesh is watertight.
    """

    fraction: float
    mesh: trimesh.Trimesh | None
    parts: int
    closed: bool

    @property
    def whole(self) -> bool:
        """Whether it is one connected, closed mesh."""
        return self.parts == 1 and self.closed

    def at(self, fraction: float) -> InterpolatedSolid:
        """The same solid at another fraction."""
        return replace(self, fraction=fraction)


def interpolate(
    shapes: DeepSdf, first: Tensor, second: Tensor, steps: int, resolution: int = RESOLUTION
) -> Iterator[InterpolatedSolid]:
    """The solids of ``steps`` codes spaced evenly from ``first`` (C,) to ``second`` (C,), both included.

    Raises:
        InputError: there are fewer than two steps, or a code has another length.
    """
    if steps < 2:
        raise InputError(f"an interpolation of {steps} steps has no two ends; give at least 2")
    for fraction in torch.linspace(0, 1, steps).tolist():
        yield interpolated_solid(shapes, (1 - fraction) * first + fraction * second, fraction, resolution)


def interpolated_solid(shapes: DeepSdf, code: Tensor, fraction: float, resolution: int) -> InterpolatedSolid:
    """The solid of ``code`` (C,), meshed with ``resolution`` cells along the cube.

    Raises:
        InputError: the code has another length.
    """
    surface = shapes.surface(code)
    try:
        mesh = polygonize(surface, resolution)
    except InputError:
        return InterpolatedSolid(fraction, None, 0, False)
    return InterpolatedSolid(fraction, mesh, int(mesh.body_count), bool(mesh.is_watertight))
