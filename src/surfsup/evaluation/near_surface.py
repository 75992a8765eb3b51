"""Which particles are near the solid or inside it, frame by frame, with as few distance queries as possible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from surfsup.io.trajectory import Trajectory
from surfsup.scene import Scene
from surfsup.scene.solids import Solids, build_solids
from surfsup.sdf import MeshSurface, NeuralSurface, Surface

ROUNDING = 1e-6  # meters; distances are float32


def surface_for_metrics(scene: Scene) -> Surface | None:
    """The solid of ``scene`` with exact distances, for metrics; None for an empty container.

    Primitives are exact. Meshes use exact triangle distances instead of their grids. Neural surfaces use the mesh of
    their zero level set, because the network's value is accurate only there (supplement, section 6.1).

    Raises:
        InputError: a mesh file is missing or not valid.
    """
    return with_exact_distances(scene.build_surface())


def solids_for_metrics(trajectory: Trajectory) -> Solids:
    """The solids of a trajectory with exact distances, those that move in their own frames.

    Raises:
        InputError: a mesh file is missing or not valid.
    """
    solids = build_solids(trajectory.scene, list(trajectory.poses))
    for surface in (solids.still, *(solid.surface for solid in solids.moving)):
        with_exact_distances(surface)
    return solids


def with_exact_distances(surface: Surface | None) -> Surface | None:
    """The same surface, whose meshes and networks answer with exact distances from now on."""
    for part in () if surface is None else surface.modules():
        if isinstance(part, MeshSurface | NeuralSurface):
            part.exact = True
    return surface


@dataclass(frozen=True)
class Contact:
    """The particles of one frame relative to the solid.

    Attributes:
        near: (N,) whether a particle's distance is below the threshold.
        depths: (K,) signed distances of the K particles inside the solid, all negative, meters.
    """

    near: np.ndarray
    depths: np.ndarray


class ContactTracker:
    """Classifies the particles of one trajectory, frame after frame, and skips queries that cannot change the result.

    A signed distance changes no faster than the particle moves. A particle that was 0.3 m away and has since moved
    0.1 m is still not near, so it needs no query. The same holds for a particle at rest between surface and threshold.
    The result equals that of a query for every particle in every frame. A particle with a non-finite position is
    neither near nor inside.

    Args:
        surface: the solid, or None.
        threshold: meters; a particle with a smaller distance is near.
    """

    def __init__(self, surface: Surface | None, threshold: float) -> None:
        self.surface, self.threshold = surface, threshold
        self.distance = np.zeros(0)  # at the last query
        self.query_position = np.zeros((0, 3))

    @torch.no_grad()
    def classify(self, positions: np.ndarray) -> Contact:
        """The contact of the next frame's ``positions`` (N, 3), meters; N is the same in every frame."""
        count = len(positions)
        if self.surface is None:
            return Contact(np.zeros(count, dtype=bool), np.zeros(0))
        if len(self.distance) == 0:
            self.distance, self.query_position = np.full(count, np.nan), np.full((count, 3), np.nan)
        path = np.linalg.norm(positions - self.query_position, axis=1) + ROUNDING
        lower, upper = self.distance - path, self.distance + path
        known = (lower > self.threshold) | ((lower > 0) & (upper < self.threshold))
        finite = np.isfinite(positions).all(axis=1)
        queried = np.flatnonzero(~known & finite)
        if len(queried):
            points = torch.from_numpy(np.ascontiguousarray(positions[queried]))
            self.distance[queried] = self.surface.distance(points).numpy()
            self.query_position[queried] = positions[queried]
        return Contact((self.distance < self.threshold) & finite, self.distance[queried][self.distance[queried] < 0])
