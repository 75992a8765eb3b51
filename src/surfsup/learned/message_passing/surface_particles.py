"""A surface as particles, for the baseline that knows no distance."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
import torch
from torch import Tensor

from surfsup.sdf import Surface, Transformed

CANDIDATES = 5  # points drawn evenly by area for each that is kept
RESOLUTION = 96  # cells of marching cubes where a surface has no triangles


class SurfaceParticles:
    """Poisson-disk samples of surfaces, each drawn once and then kept as long as its surface lives.

    Attributes:
        count: how many a surface.
        seed: of the points that are drawn from.
    """

    def __init__(self, count: int, seed: int = 0) -> None:
        self.count, self.seed = count, seed
        self._drawn: WeakKeyDictionary[Surface, Tensor] = WeakKeyDictionary()

    def on(self, surface: Surface) -> Tensor:
        """The particles (count, 3) of ``surface``, meters; a surface that is turned takes them along."""
        if isinstance(surface, Transformed):
            with torch.no_grad():
                own = self.on(surface.surface).to(surface.rotation)
                return surface.scale * own @ surface.rotation.T + surface.translation
        if surface not in self._drawn:
            points = poisson_disk(surface, self.count, self.seed)
            self._drawn[surface] = torch.from_numpy(points).to(surface.bounds())
        return self._drawn[surface]


def poisson_disk(surface: Surface, count: int, seed: int) -> np.ndarray:
    """Exactly ``count`` points (count, 3) float32 on a surface, none much nearer to the next than any other.

    Farthest-point sampling (Eldar et al. 1997) of points drawn evenly by area: each new one is that which is farthest
    from all before. So with r the last one's distance no two are nearer than r, and no point drawn is farther than r
    from one: a Poisson-disk sample that is full.

    Raises:
        InputError: the surface has no triangles.
    """
    import trimesh

    mesh = surface.to_mesh(RESOLUTION)
    drawn, _ = trimesh.sample.sample_surface(mesh, CANDIDATES * count, seed=seed)
    points = np.ascontiguousarray(drawn.T, dtype=np.float32)
    chosen = np.zeros(count, dtype=np.int64)
    apart = np.full(len(drawn), np.inf, dtype=np.float32)
    for place in range(1, count):
        away = points - points[:, chosen[place - 1], None]
        np.minimum(apart, np.einsum("ij,ij->j", away, away), out=apart)
        chosen[place] = apart.argmax()
    return points.T[chosen]
