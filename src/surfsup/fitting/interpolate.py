"""The solids between two latent codes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch
import trimesh
from torch import Tensor

from surfsup.errors import InputError
from surfsup.sdf.marching_cubes import polygonize
from surfsup.sdf.neural.deepsdf import DeepSdf

RESOLUTION = 96  # cells along the cube


@dataclass(frozen=True)
class Between:
    """A solid on the way from one code to another.

    Attributes:
        share: of the second code, 0 to 1.
        mesh: of it, in the cube of side 2; None where the code has no inside.
        parts: connected parts of the mesh.
        closed: whether the mesh is.
    """

    share: float
    mesh: trimesh.Trimesh | None
    parts: int
    closed: bool

    @property
    def whole(self) -> bool:
        """Whether it is one connected, closed mesh."""
        return self.parts == 1 and self.closed

    def at(self, share: float) -> Between:
        """The same solid at another share."""
        return replace(self, share=share)


def interpolate(
    shapes: DeepSdf, first: Tensor, second: Tensor, steps: int, resolution: int = RESOLUTION
) -> Iterator[Between]:
    """The solids of ``steps`` codes evenly from ``first`` (C,) to ``second`` (C,), both ends among them.

    Raises:
        InputError: there are fewer than two steps, or a code is of another length.
    """
    if steps < 2:
        raise InputError(f"an interpolation of {steps} steps has no two ends; give at least 2")
    for share in torch.linspace(0, 1, steps).tolist():
        yield solid_between(shapes, (1 - share) * first + share * second, share, resolution)


def solid_between(shapes: DeepSdf, code: Tensor, share: float, resolution: int) -> Between:
    """The solid of ``code`` (C,), which lies at ``share`` of the way; ``resolution`` cells along the cube.

    Raises:
        InputError: the code is of another length.
    """
    surface = shapes.surface(code)
    try:
        mesh = polygonize(surface, resolution)
    except InputError:
        return Between(share, None, 0, False)
    return Between(share, mesh, int(mesh.body_count), bool(mesh.is_watertight))
