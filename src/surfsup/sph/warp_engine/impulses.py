"""The impulses of the water on solids and walls in Warp; as ``native/sph/impulses.hpp``.

Every change of a particle's velocity by a solid is added to the solid with the opposite sign.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
import warp as wp
from torch import Tensor

from surfsup import warp_runtime as runtime
from surfsup.sph.environment import Environment
from surfsup.sph.warp_engine.kernels.boundary import NO_SOLID, boundary_kernels

if TYPE_CHECKING:
    from surfsup.sph.warp_engine.frame import Frame

WALLS = 0  # the row of the walls; those of what stands still follow, then those of what moves


class ImpulseSums:
    """Sums by solid, on the device.

    Args:
        environment: whose impulses are requested.
        positions: (N, 3) at the start of the step.
        masses: (N,) of the particles of a mixture; None where all are 1.

    Attributes:
        rows: (R, 6) float64, impulse and its moment about the origin of the world, m/s and m²/s.
    """

    def __init__(self, environment: Environment, positions: Tensor, masses: np.ndarray | None = None) -> None:
        assert environment.impulses is not None
        self.impulses, self.motion = environment.impulses, environment.motion
        self.device = positions.device
        self._reset(positions.detach().float().cpu().numpy(), masses)

    def _reset(self, positions: np.ndarray, masses: np.ndarray | None) -> None:
        rows, part_of, masses = self.impulses.native(positions, masses)
        self.still_count = len(self.impulses.solids.parts)
        self.rows, self.part_of, self.masses = (
            None if value is None else torch.from_numpy(value).to(self.device) for value in (rows, part_of, masses)
        )

    def add(self, row: int | None, impulses: Tensor, positions: Tensor, particles: Tensor) -> None:
        """Add impulses (K, 3) of unit masses at positions (K, 3).

        Args:
            row: of the solid; None for what stands still, of which each particle has its own part.
            impulses: that the solid receives, m/s.
            positions: meters.
            particles: (K,) their indices.
        """
        assert self.rows is not None
        given = impulses.detach().double()
        if self.masses is not None:
            given = given * self.masses[particles][:, None].double()
        both = torch.cat([given, torch.linalg.cross(positions.detach().double(), given)], dim=1)
        if row is not None:
            self.rows[row] += both.sum(dim=0)
        elif self.part_of is None:
            self.rows[1] += both.sum(dim=0)
        else:
            self.rows.index_add_(0, 1 + self.part_of[particles].long(), both)

    def moving_row(self, number: int) -> int:
        """The row of a solid that moves."""
        return 1 + self.still_count + number

    def finish(self) -> None:
        """Give the sums to the environment. Waits for the device."""
        assert self.rows is not None
        self.impulses.add(self.rows.cpu().numpy(), self.motion)


def add_pressure_impulses(
    frame: Frame, sums: ImpulseSums, number: int, positions: wp.array, pressure: wp.array
) -> None:
    """Add the impulses of the pressures (N,) in a substep: the pressure times a solid's density gradient."""
    order = runtime.to_torch(frame.search.order).long()
    at, pressures = runtime.to_torch(positions), runtime.to_torch(pressure)[:, None]
    density, gradient = frame.reals(), frame.vectors()

    def add(row: int | None) -> None:
        sums.add(row, pressures * runtime.to_torch(gradient), at, order)

    boundary, kernel = frame.boundary, boundary_kernels(frame.precision).evaluate_boundary
    if boundary.walls is None:
        frame.launch(kernel, [positions, *frame.solid, *boundary.walls_alone], [density, gradient])
        add(WALLS)
    if boundary.solid != NO_SOLID:
        frame.launch(kernel, [positions, *frame.solid, *boundary.solid_alone], [density, gradient])
        add(None)
    if frame.moving is None:
        return
    for k in range(len(boundary.bodies) + (boundary.walls is not None)):
        frame.moving.evaluate_one(positions, number, k, [density, gradient])
        add(sums.moving_row(k) if k < len(boundary.bodies) else WALLS)
