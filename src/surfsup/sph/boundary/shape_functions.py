"""The cubic shape functions of a map's cells: 32 nodes, eight at the corners and two on each edge.

These are cubic serendipity elements (Koschier et al., "Hierarchical hp-Adaptive Signed Distance Fields", 2016), with
the node order of the library Discregrid.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import torch
from torch import Tensor

STEPS_PER_CELL = 3  # lattice steps along a cell's edge, which has two nodes between its corners

# Nodes in lattice steps from the cell's lowest corner: the corners, then two on each edge along x, along y, along z.
CORNERS = [(x, y, z) for z in (0, 3) for y in (0, 3) for x in (0, 3)]
EDGES_X = [(step, y, z) for y in (0, 3) for z in (0, 3) for step in (1, 2)]
EDGES_Y = [(x, step, z) for z in (0, 3) for x in (0, 3) for step in (1, 2)]
EDGES_Z = [(x, y, step) for x in (0, 3) for y in (0, 3) for step in (1, 2)]
CELL_NODES = np.array(CORNERS + EDGES_X + EDGES_Y + EDGES_Z)
# The lattice points of a cell that are not nodes: on its faces and inside.
OTHER_POINTS = np.array(sorted(set(np.ndindex(4, 4, 4)) - set(map(tuple, CELL_NODES.tolist()))))


def local_coordinates(steps: np.ndarray) -> np.ndarray:
    """Lattice ``steps`` (K, 3) as coordinates in a cell that spans -1 to 1."""
    return steps * 2 / STEPS_PER_CELL - 1


def shape_functions(local: Tensor) -> tuple[Tensor, Tensor]:
    """The shape functions of a cell's nodes and their gradients at local coordinates ``local`` (N, 3).

    Each function is 1 at its own node and 0 at the others.

    Returns:
        Values (N, 32) and derivatives (N, 3, 32) along the local axes.
    """
    nodes = torch.from_numpy(local_coordinates(CELL_NODES)).to(local).T  # (3, 32)
    at = local[:, :, None]
    linear = 1 + nodes * at
    third = 1 + 9 * nodes * at
    bubble = (1 - at**2) * third
    bubble_slope = -2 * at * third + (1 - at**2) * 9 * nodes
    between = nodes.abs() < 0.5  # the axis along which an edge node is between two corners
    corner = ~between.any(dim=0)
    factor = torch.where(between, bubble, linear)
    slope = torch.where(between, bubble_slope, nodes)
    radial = 9 * at.square().sum(dim=1) - 19
    others = torch.stack([factor[:, 1] * factor[:, 2], factor[:, 0] * factor[:, 2], factor[:, 0] * factor[:, 1]], dim=1)
    product = others[:, 0] * factor[:, 0]
    values = torch.where(corner, product * radial / 64, product * 9 / 64)
    at_corner = (slope * others * radial[:, None] + product[:, None] * 18 * at) / 64
    return values, torch.where(corner, at_corner, slope * others * 9 / 64)


@cache
def interpolation_matrix() -> np.ndarray:
    """The matrix (32, 32) from the values at a cell's nodes to those at the other points of its lattice."""
    return shape_functions(torch.from_numpy(local_coordinates(OTHER_POINTS)))[0].numpy()
