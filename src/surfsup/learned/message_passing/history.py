"""What a message-passing simulator remembers of the fluid: its last moves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from surfsup.sph.state import FRAME_TIME, free_fall_lag


@dataclass(frozen=True)
class History:
    """The fluid at the end of a frame and how it got there.

    Attributes:
        positions: (N, 3), meters.
        velocities: (N, 3), m/s; at the end of the frame where the simulator knows it, else the mean of its last step.
        moves: (N, T, 3), meters moved in each of the last T steps, the last one first.
    """

    positions: Tensor
    velocities: Tensor
    moves: Tensor

    @classmethod
    def in_free_fall(
        cls, positions: Tensor, velocities: Tensor, gravity: Tensor, steps: int = 4, stride: int = 1
    ) -> History:
        """A history of ``steps`` steps of ``stride`` frames, all of them in free fall, exact as the solver falls."""
        frame = torch.arange(steps * stride, device=positions.device, dtype=positions.dtype)[:, None]
        last = FRAME_TIME * velocities - free_fall_lag(gravity)
        moves = last[:, None] - frame * FRAME_TIME**2 * gravity
        return cls(positions, velocities, moves.unflatten(1, (steps, stride)).sum(dim=2))

    @classmethod
    def of_frames(cls, positions: Tensor, velocities: Tensor, stride: int = 1) -> History:
        """The history at the last of consecutive frames.

        Args:
            positions: (steps * stride + 1, N, 3), meters.
            velocities: (N, 3) at the last frame, m/s.
            stride: frames in a step.
        """
        moves = positions[::stride].diff(dim=0).flip(0).transpose(0, 1).contiguous()
        return cls(positions[-1], velocities, moves)

    def moved_to(self, positions: Tensor, velocities: Tensor) -> History:
        """The history one step later."""
        move = (positions - self.positions)[:, None]
        return History(positions, velocities, torch.cat([move, self.moves[:, :-1]], dim=1))

    def detach(self) -> History:
        """The same history without its gradients."""
        return replace(self, **{name: value.detach() for name, value in vars(self).items()})
