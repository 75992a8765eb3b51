"""The supplement's ablation that is told nothing of the surface."""

from __future__ import annotations

from typing import ClassVar

from torch import Tensor

from surfsup.model.message_passing.history import History
from surfsup.model.message_passing.simulator import MessagePassingSimulator
from surfsup.model.state import Surroundings


class NoSdf(MessagePassingSimulator):
    """Particles and walls alone."""

    kind: ClassVar[str] = "no-sdf"
    extra_features: ClassVar[int] = 0

    def see_extra(self, nodes: History, around: Surroundings) -> Tensor:
        """Nothing."""
        return nodes.positions[:, :0]
