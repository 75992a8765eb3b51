"""An ablation of the supplement: the signed distance without its gradient."""

from __future__ import annotations

from typing import ClassVar

from torch import Tensor

from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.learned.message_passing.surfsup import scaled_distance
from surfsup.sph.environment import Environment


class ValueOnly(MessagePassingSimulator):
    """The paper's network with the signed distance, but without its gradient."""

    kind: ClassVar[str] = "value-only"
    surface_feature_count: ClassVar[int] = 1

    def surface_features(self, nodes: History, environment: Environment) -> Tensor:
        """The clipped signed distance (1) at each node."""
        return scaled_distance(environment.distance_and_normal(nodes.positions)[0])
