"""SURFSUP: the node features include the signed distance of the surface and its gradient."""

from __future__ import annotations

from typing import ClassVar

import torch
from torch import Tensor

from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.scene import NEAR_SURFACE_DISTANCE
from surfsup.sph.environment import Environment

MAXIMUM = 2.0  # in units of NEAR_SURFACE_DISTANCE; larger distances are clipped


class Surfsup(MessagePassingSimulator):
    """The paper's simulator (supplement, section 6)."""

    kind: ClassVar[str] = "surfsup"
    surface_feature_count: ClassVar[int] = 4

    def surface_features(self, nodes: History, environment: Environment) -> Tensor:
        """The clipped signed distance (1) at each node and its gradient (3), which fades with the distance."""
        distance, normal = environment.distance_and_normal(nodes.positions)
        if self.architecture.features > 1:
            normal = faded_normal(distance, normal)
        return torch.cat([scaled_distance(distance), normal], dim=-1)


def scaled_distance(distance: Tensor) -> Tensor:
    """Signed distances (N,) in meters as a node feature (N, 1): in near-surface distances, clipped to MAXIMUM.

    The paper gives neither the unit nor the limit. No force depends on the distance from a surface far away, so it is
    clipped. A scene without a surface has the maximum everywhere.
    """
    return (distance / NEAR_SURFACE_DISTANCE).clamp(-MAXIMUM, MAXIMUM)[:, None]


def faded_normal(distance: Tensor, normal: Tensor) -> Tensor:
    """Normals (N, 3) that fade from NEAR_SURFACE_DISTANCE on and are zero where :func:`scaled_distance` clips.

    So a surface far away gives the features of no surface. Training scenes have a surface below all water: a network
    with the normal of far surfaces let a block hover that was released beside a surface, or without one.
    """
    return normal * (MAXIMUM - distance / NEAR_SURFACE_DISTANCE).clamp(0, 1)[:, None]
