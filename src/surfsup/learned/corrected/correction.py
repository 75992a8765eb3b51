"""The correction that a network adds to a frame of the solver: pressures, and the motion they cause."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from surfsup.learned.corrected.features import DISPLACEMENT_SCALE, scaled_density_rate
from surfsup.scene import FRAME_TIME
from surfsup.sph.dfsph import pressure_velocity
from surfsup.sph.energy import MAX_DELTA_VELOCITY
from surfsup.sph.solver import Observation

POSITION_SHARE = 0.62  # displacement over velocity correction times frame time, in the same frame (measured)
PRESSURE_SCALE = 5e-4  # m²/s: at a density gradient of 40 per meter it causes one DISPLACEMENT_SCALE per frame
MAX_CORRECTION = MAX_DELTA_VELOCITY * FRAME_TIME / DISPLACEMENT_SCALE


@dataclass(frozen=True)
class Correction:
    """Corrections of positions and velocities, in ``DISPLACEMENT_SCALE``.

    Attributes:
        velocity: (N, 3), to the end velocity times the frame time.
        position: (N, 3), to the position.
    """

    velocity: Tensor
    position: Tensor

    @classmethod
    def from_pressure(cls, output: Tensor, observation: Observation) -> Correction:
        """The correction by pressures that reduce a positive density rate.

        Pressure forces are symmetric, so momentum is conserved. A network that chose velocities freely improved single
        frames and worsened rollouts (measured). Where the density rate is not positive the pressure is zero: a network
        that chose any pressure carried part of a pool's weight by one impulse a frame, and the pool trembled.

        Args:
            output: (N,) of the network, in units of ``PRESSURE_SCALE`` and the scaled density rate; negative values
                count as zero.
            observation: the frame to correct.
        """
        pressure = PRESSURE_SCALE * output.clamp(min=0) * scaled_density_rate(observation).clamp(min=0)
        substep = observation.substep
        removed = pressure_velocity(pressure, substep.density_gradient, substep.graph)
        velocity = -removed * (FRAME_TIME / DISPLACEMENT_SCALE)
        return cls(velocity, POSITION_SHARE * velocity)

    def bounded(self, bound: float = MAX_CORRECTION) -> Correction:
        """The same, shortened where the velocity exceeds ``bound``: no output of the network can scatter the water."""
        length = torch.linalg.vector_norm(self.velocity, dim=-1, keepdim=True)
        fraction = (bound / length.clamp(min=1e-6)).clamp(max=1)
        return Correction(fraction * self.velocity, fraction * self.position)

    def added_to(self, positions: Tensor, velocities: Tensor) -> tuple[Tensor, Tensor]:
        """Corrected positions (N, 3) in meters and velocities (N, 3) in m/s."""
        return (
            positions + DISPLACEMENT_SCALE * self.position,
            velocities + DISPLACEMENT_SCALE / FRAME_TIME * self.velocity,
        )
