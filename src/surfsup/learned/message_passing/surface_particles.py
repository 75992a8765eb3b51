"""Particles on a surface, for the baseline that has no signed distance."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
import torch
from torch import Tensor

from surfsup.sdf import Surface, Transformed

CANDIDATES = 5  # points drawn uniformly by area for each that is kept
RESOLUTION = 96  # cells of marching cubes for surfaces without triangles
SEED = 0  # of the candidates


class SurfaceParticles:
    """Poisson-disk samples of surfaces, drawn once for each surface and kept while it lives.

    Attributes:
        count: particles on each surface.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._samples: WeakKeyDictionary[Surface, Tensor] = WeakKeyDictionary()

    def of(self, surface: Surface) -> Tensor:
        """The particles (count, 3) on ``surface``, meters. Those of a transformed surface are transformed with it."""
        if isinstance(surface, Transformed):
            with torch.no_grad():
                inner = self.of(surface.surface).to(surface.rotation)
                return surface.scale * inner @ surface.rotation.T + surface.translation
        if surface not in self._samples:
            points = poisson_disk(surface, self.count, SEED)
            self._samples[surface] = torch.from_numpy(points).to(surface.bounds())
        return self._samples[surface]


def poisson_disk(surface: Surface, count: int, seed: int) -> np.ndarray:
    """Exactly ``count`` points (count, 3) float32 on a surface, evenly spaced.

    Farthest-point sampling (Eldar et al. 1997) of points drawn uniformly by area: each new point is the candidate
    farthest from all points before it. If the last one was at distance r, no two points are nearer than r and no
    candidate is more than r away from a point: a maximal Poisson-disk sample.

    Raises:
        InputError: the surface has no triangles.
    """
    import trimesh

    mesh = surface.to_mesh(RESOLUTION)
    candidates, _ = trimesh.sample.sample_surface(mesh, CANDIDATES * count, seed=seed)
    points = np.ascontiguousarray(candidates.T, dtype=np.float32)
    chosen = np.zeros(count, dtype=np.int64)
    squared_distance = np.full(len(candidates), np.inf, dtype=np.float32)
    for number in range(1, count):
        offset = points - points[:, chosen[number - 1], None]
        np.minimum(squared_distance, np.einsum("ij,ij->j", offset, offset), out=squared_distance)
        chosen[number] = squared_distance.argmax()
    return points.T[chosen]
