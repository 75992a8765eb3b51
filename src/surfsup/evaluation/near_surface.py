"""Which particles are near the solid or in it, frame after frame, by as few queries as possible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from surfsup.scene import Scene
from surfsup.sdf import MeshSurface, NeuralSurface, Surface

ROUNDING = 1e-6  # meters: distances are float32


def surface_for_metrics(scene: Scene) -> Surface | None:
    """The solid of ``scene`` by whose distances trajectories are judged; None for an empty container.

    Primitives give their own exact distance, meshes are asked triangle by triangle instead of by their grids, and so
    are the meshes of neural surfaces, which are trusted at their zero only (supplement, section 6.1).

    Raises:
        InputError: a mesh file is missing or not usable.
    """
    surface = scene.build_surface()
    if surface is not None:
        for part in surface.modules():
            if isinstance(part, MeshSurface | NeuralSurface):
                part.exact = True
    return surface


@dataclass(frozen=True)
class Contact:
    """A frame's particles against the solid.

    Attributes:
        near: (N,) which of them have a distance below the threshold.
        depths: (K,) the distances of the K particles that are inside the solid, all below zero, meters.
    """

    near: np.ndarray
    depths: np.ndarray


class NearSurface:
    """Follows the particles of one trajectory and asks for a distance only where the answer could matter.

    A distance changes no faster than the particle moves. So who was 0.3 m away and has moved 0.1 m since is
    still not near, and needs no query; nor does who rests well between surface and threshold. The result is
    the same as asking for every particle in every frame. A particle that is no number is nowhere.

    Args:
        surface: the solid, or None.
        threshold: meters.
    """

    def __init__(self, surface: Surface | None, threshold: float) -> None:
        self.surface, self.threshold = surface, threshold
        self.known = np.zeros(0)
        self.asked_at = np.zeros((0, 3))

    @torch.no_grad()
    def look(self, positions: np.ndarray) -> Contact:
        """The contact of the next frame's ``positions`` (N, 3), meters; N is the same in every frame."""
        count = len(positions)
        if self.surface is None:
            return Contact(np.zeros(count, dtype=bool), np.zeros(0))
        if len(self.known) == 0:
            self.known, self.asked_at = np.full(count, np.nan), np.full((count, 3), np.nan)
        moved = np.linalg.norm(positions - self.asked_at, axis=1) + ROUNDING
        least, most = self.known - moved, self.known + moved
        sure = (least > self.threshold) | ((least > 0) & (most < self.threshold))
        finite = np.isfinite(positions).all(axis=1)
        asking = np.flatnonzero(~sure & finite)
        if len(asking):
            points = torch.from_numpy(np.ascontiguousarray(positions[asking]))
            self.known[asking] = self.surface.distance(points).numpy()
            self.asked_at[asking] = positions[asking]
        return Contact((self.known < self.threshold) & finite, self.known[asking][self.known[asking] < 0])
