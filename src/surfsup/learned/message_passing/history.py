"""The state of a message-passing simulator: positions and the last displacements."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from surfsup.scene import FRAME_TIME
from surfsup.sph.state import free_fall_lag

HISTORY_LENGTH = 4  # displacements in the network's input; T of the paper


@dataclass(frozen=True)
class History:
    """Particles at the end of a frame, with the displacements of the frames before.

    Attributes:
        positions: (N, 3), meters.
        velocities: (N, 3), m/s; in data at the end of the frame, in rollouts the mean over the last frame.
        displacements: (N, T, 3), meters in each of the last T frames, the latest first.
    """

    positions: Tensor
    velocities: Tensor
    displacements: Tensor

    @classmethod
    def in_free_fall(
        cls, positions: Tensor, velocities: Tensor, gravity: Tensor, length: int = HISTORY_LENGTH
    ) -> History:
        """The history of particles that have fallen freely for ``length`` frames, exact for the solver's substeps."""
        frame = torch.arange(length, device=positions.device, dtype=positions.dtype)[:, None]
        last = FRAME_TIME * velocities - free_fall_lag(gravity)
        return cls(positions, velocities, last[:, None] - frame * FRAME_TIME**2 * gravity)

    @classmethod
    def from_frames(cls, positions: Tensor, velocities: Tensor) -> History:
        """The history at the last of consecutive frames.

        Args:
            positions: (T + 1, N, 3), meters.
            velocities: (N, 3) at the last frame, m/s.
        """
        displacements = positions.diff(dim=0).flip(0).transpose(0, 1).contiguous()
        return cls(positions[-1], velocities, displacements)

    def moved_to(self, positions: Tensor, velocities: Tensor) -> History:
        """The history one frame later."""
        displacement = (positions - self.positions)[:, None]
        return History(positions, velocities, torch.cat([displacement, self.displacements[:, :-1]], dim=1))

    def detach(self) -> History:
        """The same history without its gradients."""
        return replace(self, **{name: value.detach() for name, value in vars(self).items()})
