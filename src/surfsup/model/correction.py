"""What a simulator adds to ballistic motion."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from surfsup.model.features import DISPLACEMENT_SCALE
from surfsup.model.state import FRAME_TIME

POSITION_SHARE = 0.62  # of a frame's velocity correction that shows in its displacement (measured)
LARGEST = 5.0 * FRAME_TIME / DISPLACEMENT_SCALE  # 5 m/s in a frame; of true ones one in ten thousand is beyond 4.7 m/s


@dataclass(frozen=True)
class Correction:
    """What the network adds to ballistic motion, in DISPLACEMENT_SCALE.

    Attributes:
        velocity: (N, 3), to the end velocity times the frame time.
        position: (N, 3), to the position.
    """

    velocity: Tensor
    position: Tensor

    def bounded(self, largest: float = LARGEST) -> Correction:
        """The same, but where that of the velocity is larger than ``largest`` both are shortened by as much.

        So a network that meets what it has never seen cannot tear the water apart.
        """
        size = torch.linalg.vector_norm(self.velocity, dim=-1, keepdim=True)
        share = (largest / size.clamp(min=1e-6)).clamp(max=1)
        return Correction(share * self.velocity, share * self.position)

    def added_to(self, positions: Tensor, velocities: Tensor) -> tuple[Tensor, Tensor]:
        """Positions (N, 3) in metres and velocities (N, 3) in m/s, corrected."""
        return (
            positions + DISPLACEMENT_SCALE * self.position,
            velocities + DISPLACEMENT_SCALE / FRAME_TIME * self.velocity,
        )
