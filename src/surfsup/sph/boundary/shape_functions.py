"""The cubic cells that the solver looks maps up in (Koschier et al., "Hierarchical hp-adaptive signed distance fields",
2016, as its library Discregrid has them): 32 nodes, eight at corners and two on every edge.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import torch
from torch import Tensor

NODES_A_SIDE = 3  # lattice steps a cell: two inner nodes on every edge

# The nodes in lattice steps from the cell's lowest corner, in the order of Discregrid: the corners, then two on every
# edge along x, along y and along z.
CORNERS = [(x, y, z) for z in (0, 3) for y in (0, 3) for x in (0, 3)]
EDGES_X = [(step, y, z) for y in (0, 3) for z in (0, 3) for step in (1, 2)]
EDGES_Y = [(x, step, z) for z in (0, 3) for x in (0, 3) for step in (1, 2)]
EDGES_Z = [(x, y, step) for x in (0, 3) for y in (0, 3) for step in (1, 2)]
NODES_OF_CELL = np.array(CORNERS + EDGES_X + EDGES_Y + EDGES_Z)
OTHERS_OF_CELL = np.array(sorted(set(np.ndindex(4, 4, 4)) - set(map(tuple, NODES_OF_CELL.tolist()))))  # of the lattice


def places_in_cell(steps: np.ndarray) -> np.ndarray:
    """Lattice ``steps`` (K, 3) as places in a cell that reaches from -1 to 1."""
    return steps * 2 / NODES_A_SIDE - 1


def serendipity(at: Tensor) -> tuple[Tensor, Tensor]:
    """The functions (N, 32) of a cell's nodes at places ``at`` (N, 3) in it, from -1 to 1, and their slopes (N, 3, 32).

    Each is 1 at its own node and 0 at the others.
    """
    nodes = torch.from_numpy(places_in_cell(NODES_OF_CELL)).to(at).T  # (3, 32)
    here = at[:, :, None]
    linear = 1 + nodes * here
    third = 1 + 9 * nodes * here
    bubble = (1 - here**2) * third
    bubble_slope = -2 * here * third + (1 - here**2) * 9 * nodes
    inner = nodes.abs() < 0.5
    corner = ~inner.any(dim=0)
    factor = torch.where(inner, bubble, linear)
    slope = torch.where(inner, bubble_slope, nodes)
    radial = 9 * here.square().sum(dim=1) - 19
    others = torch.stack([factor[:, 1] * factor[:, 2], factor[:, 0] * factor[:, 2], factor[:, 0] * factor[:, 1]], dim=1)
    product = others[:, 0] * factor[:, 0]
    values = torch.where(corner, product * radial / 64, product * 9 / 64)
    at_corner = (slope * others * radial[:, None] + product[:, None] * 18 * here) / 64
    return values, torch.where(corner, at_corner, slope * others * 9 / 64)


@cache
def from_nodes_to_others() -> np.ndarray:
    """The matrix (32, 32) from a cell's values at its nodes to those at the other points of its lattice."""
    return serendipity(torch.from_numpy(places_in_cell(OTHERS_OF_CELL)))[0].numpy()
