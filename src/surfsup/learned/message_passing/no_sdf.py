"""The supplement's ablation that is told nothing of the surface."""

from __future__ import annotations

from typing import ClassVar

from torch import Tensor

from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.sph.state import Environment


class NoSdf(MessagePassingSimulator):
    """Particles and walls alone."""

    kind: ClassVar[str] = "no-sdf"
    extra_features: ClassVar[int] = 0

    def see_extra(self, nodes: History, environment: Environment) -> Tensor:
        """Nothing."""
        return nodes.positions[:, :0]
