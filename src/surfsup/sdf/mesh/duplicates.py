"""Faces that a mesh has more than once: copies, sheets with two sides, and walls between bodies that touch."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from surfsup.sdf.mesh.topology import directed_edges, parts_of


def without_duplicates(
    vertices: np.ndarray, faces: np.ndarray, orient: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """``faces`` with every face at most once, and without the walls between bodies that share them.

    A doubled face is a wall if the other faces are closed without it and enclose it. Bricks that share faces become
    one solid so.

    Args:
        vertices: (V, 3).
        faces: (F, 3), all with three distinct corners.
        orient: returns the faces given to it, oriented consistently and outward.
    """
    import igl

    order = np.sort(faces, axis=1)
    _, first, number, copies = np.unique(order, axis=0, return_index=True, return_inverse=True, return_counts=True)
    if copies.max(initial=0) < 2:
        return faces
    single = copies[number.ravel()] == 1
    rest, doubled = faces[single], faces[first[copies > 1]]
    enclosed = np.zeros(len(doubled), bool)
    candidates = np.flatnonzero(leaves_no_hole(rest, doubled, len(vertices)))
    if len(candidates):
        centers = vertices[doubled[candidates]].mean(axis=1)
        winding = igl.FastWindingNumberBVH()
        winding.init(vertices, np.ascontiguousarray(orient(rest)))
        enclosed[candidates] = winding.winding_number(centers) > 0.5
    kept = np.zeros(len(faces), bool)
    kept[first] = True
    kept[first[copies > 1][enclosed]] = False
    return faces[kept]


def leaves_no_hole(rest: np.ndarray, doubled: np.ndarray, vertex_count: int) -> np.ndarray:
    """Which of the ``doubled`` faces (D, 3) can be left out without opening the ``rest`` (R, 3).

    This holds for connected groups of doubled faces whose every edge belongs to an even number of other faces.
    """
    if len(rest) == 0:
        return np.zeros(len(doubled), bool)
    group = parts_of(doubled, vertex_count)
    keys, _ = directed_edges(np.concatenate([rest, doubled]))
    keys = keys.reshape(3, -1)
    known, count = np.unique(keys[:, : len(rest)].ravel(), return_counts=True)
    edges = keys[:, len(rest) :]
    place = np.minimum(np.searchsorted(known, edges), len(known) - 1)
    others = np.where(known[place] == edges, count[place], 0)
    odd = np.bincount(group, (others % 2).sum(axis=0))
    touching = np.bincount(group, others.sum(axis=0))
    return ((odd == 0) & (touching > 0))[group]
