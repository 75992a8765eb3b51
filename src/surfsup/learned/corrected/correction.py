"""What the network adds to what the rule has made: pressures, and what these do."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from surfsup.learned.corrected.features import DISPLACEMENT_SCALE
from surfsup.sph.dfsph import pushed
from surfsup.sph.kernel_sums import Graph
from surfsup.sph.state import FRAME_TIME

POSITION_SHARE = 0.62  # of a frame's velocity correction that shows in its displacement (measured)
PRESSURE_SCALE = 5e-4  # m²/s: what, where density's slope is 40 a meter, makes a DISPLACEMENT_SCALE a frame
LARGEST = 5.0 * FRAME_TIME / DISPLACEMENT_SCALE  # 5 m/s in a frame; of true ones one in ten thousand is beyond 4.7 m/s


@dataclass(frozen=True)
class Correction:
    """What is added to places and velocities, in DISPLACEMENT_SCALE.

    Attributes:
        velocity: (N, 3), to the end velocity times the frame time.
        position: (N, 3), to the position.
    """

    velocity: Tensor
    position: Tensor

    @classmethod
    def against(cls, rise: Tensor, shares: Tensor, slope: Tensor, scale: float, seen: Graph) -> Correction:
        """What pressures against the rise of density do to the particles, which push each other and solids, equally.

        So nothing that a network says moves the water as a whole, nor presses it together: a network free to say any
        velocity did, and made single frames better and rollouts worse (measured). Where density does not rise it says
        nothing: a network free to say any pressure carried a part of a pool in one push a frame, and made it tremble.

        Args:
            rise: (N,) of density, told as in :mod:`.features`; a fall counts as none.
            shares: (N,) of it, in PRESSURE_SCALE; negative ones count as none.
            slope: (N, 3) of density, 1/m.
            scale: from the kernels' slope to density's, 1/m.
            seen: the neighbors.
        """
        taken = pushed(PRESSURE_SCALE * shares.clamp(min=0) * rise.clamp(min=0), slope, scale, seen)
        velocity = -taken * (FRAME_TIME / DISPLACEMENT_SCALE)
        return cls(velocity, POSITION_SHARE * velocity)

    def bounded(self, largest: float = LARGEST) -> Correction:
        """The same, but where that of the velocity is larger than ``largest`` both are shortened by as much.

        So a network that meets what it has never seen cannot tear the water apart.
        """
        size = torch.linalg.vector_norm(self.velocity, dim=-1, keepdim=True)
        share = (largest / size.clamp(min=1e-6)).clamp(max=1)
        return Correction(share * self.velocity, share * self.position)

    def added_to(self, positions: Tensor, velocities: Tensor) -> tuple[Tensor, Tensor]:
        """Positions (N, 3) in meters and velocities (N, 3) in m/s, corrected."""
        return (
            positions + DISPLACEMENT_SCALE * self.position,
            velocities + DISPLACEMENT_SCALE / FRAME_TIME * self.velocity,
        )
