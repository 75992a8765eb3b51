"""SURFSUP: particles are told the signed distance of the surface and its gradient."""

from __future__ import annotations

from typing import ClassVar

import torch
from torch import Tensor

from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.scene import NEAR_SURFACE_DISTANCE
from surfsup.sph.state import Environment

FARTHEST = 2.0  # of NEAR_SURFACE_DISTANCE: what is farther is told as this far


class Surfsup(MessagePassingSimulator):
    """The paper's simulator."""

    kind: ClassVar[str] = "surfsup"
    extra_features: ClassVar[int] = 4

    def see_extra(self, nodes: History, environment: Environment) -> Tensor:
        """Signed distance (1), cut off far away, and its gradient (3), at the particles' places now."""
        distance, normal = environment.distance_and_normal(nodes.positions)
        return torch.cat([told_distance(distance), normal], dim=-1)


def told_distance(distance: Tensor) -> Tensor:
    """Signed distances (N,) in meters as the network is told them, (N, 1).

    Neither unit nor cut-off is in the paper: this is a choice of ours. It keeps the height above a far surface, which
    no force depends on, out of what is learned, and stands for no surface at all.
    """
    return (distance / NEAR_SURFACE_DISTANCE).clamp(-FARTHEST, FARTHEST)[:, None]
