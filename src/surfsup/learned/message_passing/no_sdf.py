"""An ablation of the supplement: no input about the surface."""

from __future__ import annotations

from typing import ClassVar

from torch import Tensor

from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.sph.environment import Environment


class NoSdf(MessagePassingSimulator):
    """The paper's network with particles and walls alone."""

    kind: ClassVar[str] = "no-sdf"
    surface_feature_count: ClassVar[int] = 0

    def surface_features(self, nodes: History, environment: Environment) -> Tensor:
        """No features, (M, 0)."""
        return nodes.positions[:, :0]
