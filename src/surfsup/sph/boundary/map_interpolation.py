"""The solid as the solver feels it: distance, and its share of a particle's neighborhood, in cubic cells.

The tables are those that the solver is given (:mod:`surfsup.sph.boundary.scene_boundaries`), made when they are first asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.errors import InputError
from surfsup.scene import Container
from surfsup.sdf import Surface
from surfsup.sph.boundary.density import DEEPEST, VOLUME_FACTOR
from surfsup.sph.boundary.scene_boundaries import map_in
from surfsup.sph.boundary.shape_functions import NODES_OF_CELL, serendipity
from surfsup.sph.kernels import KERNEL_SUPPORT

WHOLE = VOLUME_FACTOR * 4 / 3 * np.pi * KERNEL_SUPPORT**3  # m³: what the solver sees of a solid that is all around
NODES = len(NODES_OF_CELL)
UNTURNED = np.eye(3, dtype=np.float32)


@dataclass(frozen=True)
class Tables:
    """The cells of a map that have nodes.

    Attributes:
        lower: (3,) the grid's lowest corner, meters.
        cell: (3,) sides of a cell, meters.
        resolution: (3,) cells along each axis.
        places: (cells,) where a cell is among those that have nodes, x fastest; -1 where it has none.
        nodes: (M + 1, 2, 32) distance in meters and share at each cell's nodes; behind the last, those of a far place.
    """

    lower: np.ndarray
    cell: np.ndarray
    resolution: np.ndarray
    places: np.ndarray
    nodes: np.ndarray

    @classmethod
    def of(cls, surface: Surface, container: Container) -> Tables:
        """The solver's map of ``surface`` but for its depths; of no cell where it is far from the container."""
        try:
            made = map_in(surface, container, -DEEPEST)
        except InputError:
            nowhere = np.zeros(3, np.float32), np.ones(3, np.float32), np.ones(3, np.int32)
            return cls(*nowhere, np.full(1, -1, np.int32), far_nodes())
        places = np.full(int(made.resolution.prod()), -1, np.int32)
        places[made.kept] = np.arange(len(made.kept))
        nodes = np.stack([made.distances[made.nodes], made.volumes[made.nodes] / WHOLE], axis=1).astype(np.float32)
        grid = made.lower.astype(np.float32), made.cell.astype(np.float32), made.resolution.astype(np.int32)
        return cls(*grid, places, np.concatenate([nodes, far_nodes()]))

    @cached_property
    def native(self) -> native.SolidMap:
        """The same for the native step, which keeps a copy."""
        return native.SolidMap(self.lower, self.cell, self.resolution, self.places, self.nodes)

    def on(self, device: torch.device, dtype: torch.dtype) -> tuple[Tensor, ...]:
        """All of them as tensors on a device; those of lengths and shares in a precision."""
        if (device, dtype) not in self._tensors:
            real, whole = (self.lower, self.cell, self.nodes), (self.resolution, self.places)
            lower, cell, nodes = (torch.from_numpy(part).to(device, dtype) for part in real)
            resolution, places = (torch.from_numpy(part).to(device) for part in whole)
            self._tensors[device, dtype] = lower, cell, resolution, places, nodes
        return self._tensors[device, dtype]

    @cached_property
    def _tensors(self) -> dict[tuple[torch.device, torch.dtype], tuple[Tensor, ...]]:
        return {}


class SolidMap:
    """Distance, share and normal of one scene's solid, turned with it where the scene is seen through a symmetry.

    Args:
        made: makes the tables, or gives those that were made.
        turn: (3, 3) orthogonal; points are looked up where its transpose takes them.
    """

    def __init__(self, made: Callable[[], Tables], turn: np.ndarray = UNTURNED) -> None:
        self._made, self.turn = made, turn

    @classmethod
    def of(cls, surface: Surface, container: Container) -> SolidMap:
        """The map of ``surface``, whose tables are made when they are first asked for."""
        return cls(cache(lambda: Tables.of(surface, container)))

    @property
    def tables(self) -> Tables:
        """The tables."""
        return self._made()

    def turned(self, matrix: Tensor) -> SolidMap:
        """The same solid turned or mirrored by an orthogonal ``matrix`` (3, 3)."""
        return SolidMap(self._made, matrix.cpu().numpy().astype(np.float32) @ self.turn)

    def look(self, places: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Distance (N,) in meters, share (N,) of the neighborhood and normal (N, 3) at ``places`` (N, 3).

        Away from the solid the distance is beyond the support, the share none and the normal zero.
        """
        lower, cell, size, cells, nodes = self.tables.on(places.device, places.dtype)
        turn = torch.from_numpy(self.turn).to(places)
        steps = (places @ turn - lower) / cell
        index = steps.detach().nan_to_num().floor()
        within = ((index >= 0) & (index < size)).all(dim=-1)
        x, y, z = torch.where(within[:, None], index, 0.0).long().unbind(dim=-1)
        number = cells[x + size[0] * (y + size[1] * z)].long()
        within = within & (number >= 0)
        values, slopes = serendipity(torch.where(within[:, None], 2 * (steps - index) - 1, 0.0))
        known = nodes[torch.where(within, number, len(nodes) - 1)]
        distance, share = (known * values[:, None]).sum(dim=-1).unbind(dim=-1)
        rise = torch.where(within[:, None], (known[:, :1] * slopes).sum(dim=-1) / cell, 0.0)
        normal = torch.nn.functional.normalize(rise, dim=-1) @ turn.T
        return torch.where(places.isnan().any(dim=-1), torch.nan, distance), share, normal


def far_nodes() -> np.ndarray:
    """The nodes (1, 2, 32) of a cell that is far from any solid."""
    return np.stack([np.full(NODES, 10 * KERNEL_SUPPORT), np.zeros(NODES)])[None].astype(np.float32)
