"""The particles at the end of a frame, and their motion under gravity alone.

Positions and end-of-frame velocities are the whole state: the reference solver, restarted from them, continues as it
would have without the stop.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from surfsup.scene import FRAME_TIME

SUBSTEPS = 5  # of 1 ms in a frame, as in the reference; velocities are those at the end of the last one
SUBSTEP_TIME = FRAME_TIME / SUBSTEPS


@dataclass(frozen=True)
class FramePart:
    """A frame, or a part of one that is computed by itself.

    Attributes:
        seconds: its duration.
        substeps: number of substeps in it.
    """

    seconds: float = FRAME_TIME
    substeps: int = SUBSTEPS


WHOLE_FRAME = FramePart()


@dataclass(frozen=True)
class ParticleState:
    """The particles at the end of a frame.

    Attributes:
        positions: (N, 3), meters.
        velocities: (N, 3), m/s at the end of the frame, not the mean over it.
    """

    positions: Tensor
    velocities: Tensor

    def ballistic(self, gravity: Tensor, part: FramePart = WHOLE_FRAME) -> tuple[Tensor, Tensor]:
        """Positions (N, 3) in meters and velocities (N, 3) in m/s after a ``part`` of a frame by gravity (3,) alone."""
        seconds = part.seconds
        return (
            self.positions + seconds * self.velocities + free_fall(gravity, part),
            self.velocities + seconds * gravity,
        )

    def rows(self, index: Tensor) -> ParticleState:
        """The state of the particles in the rows ``index`` (K,)."""
        return replace(self, **{name: value[index] for name, value in vars(self).items()})

    def detach(self) -> ParticleState:
        """The same state without gradients."""
        return replace(self, **{name: value.detach() for name, value in vars(self).items()})


@dataclass(frozen=True)
class MixtureState(ParticleState):
    """The particles of liquids that do not mix.

    Attributes:
        liquids: (N,) int32, the number of each particle's liquid among those of the environment.
    """

    liquids: Tensor


def mixture_state(state: ParticleState, liquids: np.ndarray) -> MixtureState:
    """The particles of a state, each with the number (N,) of its liquid."""
    return MixtureState(state.positions, state.velocities, torch.from_numpy(np.asarray(liquids, np.int32)))


def free_fall(gravity: Tensor, part: FramePart = WHOLE_FRAME) -> Tensor:
    """Displacement in a free fall from rest, meters: n (n + 1) / 2 Δt² g for n semi-implicit substeps of Δt."""
    return part.substeps * (part.substeps + 1) / 2 * (part.seconds / part.substeps) ** 2 * gravity


def free_fall_lag(gravity: Tensor) -> Tensor:
    """End velocity times frame time minus displacement of a frame of free fall, meters: n (n - 1) / 2 Δt² g."""
    return SUBSTEPS * (SUBSTEPS - 1) / 2 * SUBSTEP_TIME**2 * gravity
