"""Which nodes of a grid are inside a closed mesh, by few winding numbers."""

from __future__ import annotations

import numpy as np

from surfsup.sdf.mesh.query import MeshQuery


def nodes_inside(query: MeshQuery, nodes: np.ndarray, distance: np.ndarray, cell: float) -> np.ndarray:
    """Whether each node (X · Y · Z,) of a grid is inside.

    Neighbors that are both more than half a cell away from a closed mesh are on the same side of it. So connected sets
    of such nodes need one winding number each; the nodes next to the mesh need their own. Winding numbers are the
    slowest part of a grid.

    Args:
        query: the mesh.
        nodes: (X · Y · Z, 3).
        distance: (X, Y, Z) unsigned, at the nodes.
        cell: distance of neighboring nodes.
    """
    from scipy import ndimage

    if not query.is_closed:
        return query.inside(nodes)
    region, _ = ndimage.label(distance > 0.5001 * cell)
    region = region.ravel()
    chosen = np.unique(region, return_index=True)[1]  # one node of each region, and one of region 0, next to the mesh
    side = query.inside(np.ascontiguousarray(nodes[chosen]))
    inside = side[region - region.min()]
    near = np.flatnonzero(region == 0)
    inside[near] = query.inside(np.ascontiguousarray(nodes[near]))
    return inside
