"""The supplement's ablation that is told the distance of the surface without its gradient."""

from __future__ import annotations

from typing import ClassVar

from torch import Tensor

from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.learned.message_passing.surfsup import told_distance
from surfsup.sph.state import Environment


class ValueOnly(MessagePassingSimulator):
    """The signed distance, without its gradient."""

    kind: ClassVar[str] = "value-only"
    extra_features: ClassVar[int] = 1

    def see_extra(self, nodes: History, environment: Environment) -> Tensor:
        """Signed distance (1), cut off far away."""
        return told_distance(environment.distance_and_normal(nodes.positions)[0])
