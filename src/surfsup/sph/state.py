"""The particles at the end of a frame, and their motion under gravity alone.

Positions and end-of-frame velocities are the whole state: the reference solver, restarted from them, continues as it
would have without the stop.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from torch import Tensor

from surfsup.scene import FRAME_TIME

SUBSTEPS = 5  # of 1 ms in a frame, as in the reference; velocities are those at the end of the last one
SUBSTEP_TIME = FRAME_TIME / SUBSTEPS


@dataclass(frozen=True)
class ParticleState:
    """The particles at the end of a frame.

    Attributes:
        positions: (N, 3), meters.
        velocities: (N, 3), m/s at the end of the frame, not the mean over it.
    """

    positions: Tensor
    velocities: Tensor

    def ballistic(self, gravity: Tensor, parts: int = 1) -> tuple[Tensor, Tensor]:
        """Positions (N, 3) in meters and velocities (N, 3) in m/s one frame later under ``gravity`` (3,) alone.

        With ``parts`` they are those after that fraction of a frame, in as many substeps.
        """
        time = FRAME_TIME / parts
        return (
            self.positions + time * self.velocities + free_fall(gravity) / parts**2,
            self.velocities + time * gravity,
        )

    def detach(self) -> ParticleState:
        """The same state without gradients."""
        return replace(self, **{name: value.detach() for name, value in vars(self).items()})


def free_fall(gravity: Tensor) -> Tensor:
    """Displacement of a frame of free fall from rest, meters: n (n + 1) / 2 Δt² g for n semi-implicit steps of Δt."""
    return SUBSTEPS * (SUBSTEPS + 1) / 2 * SUBSTEP_TIME**2 * gravity


def free_fall_lag(gravity: Tensor) -> Tensor:
    """End velocity times frame time minus displacement of a frame of free fall, meters: n (n - 1) / 2 Δt² g."""
    return SUBSTEPS * (SUBSTEPS - 1) / 2 * SUBSTEP_TIME**2 * gravity
