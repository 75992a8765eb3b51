"""The orientation of faces: consistent in every patch, outward for every body, inward for cavities."""

from __future__ import annotations

import numpy as np

from surfsup.sdf.mesh.topology import area_vectors, directed_edges, signed_volumes

NEARLY_CLOSED = 0.25  # |sum of the area vectors| / area: 0 for a closed body, 0.2 for a box without a side
SAMPLES = 8  # corners of a body that must be inside another one for the body to be nested in it
CHUNK = 2_000  # bodies compared with all others at once


def orient_consistently(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orient the faces of each patch alike; the orientation of the larger area wins.

    A patch is a set of faces connected by edges of two faces.

    Returns:
        Faces (F, 3), and the patch (F,) of each.
    """
    import igl

    patch, twisted = manifold_patches(faces)
    if not twisted.any():
        return faces, patch
    # libigl takes a time that grows with the number of patches, so it gets only those that need it.
    chosen = twisted[patch]
    before = np.ascontiguousarray(faces[chosen], dtype=np.int64)
    oriented, part = igl.bfs_orient(before)
    area = np.linalg.norm(area_vectors(vertices, before), axis=1)
    vote = np.bincount(part, weights=np.where(same_orientation(oriented, before), area, -area))
    faces = faces.copy()
    faces[chosen] = np.where((vote < 0)[part][:, None], oriented[:, ::-1], oriented)
    return faces, patch


def manifold_patches(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The patch (F,) of each face, and which patches (P,) have faces oriented against a neighbor."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    keys, direction = directed_edges(faces)
    order = np.argsort(keys, kind="stable")
    start = np.flatnonzero(np.concatenate([[True], np.diff(keys[order]) != 0]))
    pair = start[np.diff(np.append(start, len(keys))) == 2]
    first, second = order[pair], order[pair + 1]
    count = len(faces)
    graph = coo_matrix((np.ones(len(pair), np.int8), (first % count, second % count)), shape=(count, count))
    patches, patch = connected_components(graph, directed=False)
    against = direction[first] == direction[second]
    return patch, np.bincount(patch[first % count], against, patches) > 0


def same_orientation(faces: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Which faces (F,) list the same vertices as ``others`` in the same cyclic order."""
    return np.any([(faces == np.roll(others, shift, axis=1)).all(axis=1) for shift in range(3)], axis=0)


def orient_outward(vertices: np.ndarray, faces: np.ndarray, patch: np.ndarray) -> tuple[np.ndarray, int, int]:
    """Turn the bodies that are inside out.

    A body that no other contains is turned outward. One inside others keeps its orientation relative to the body
    around it, so that cavities stay cavities, unless it is within a cavity: there it can only be solid. Patches with
    large openings are evaluated together by the volume that they enclose.

    Args:
        vertices: (V, 3).
        faces: (F, 3), consistent in every patch.
        patch: (F,) of :func:`orient_consistently`.

    Returns:
        Faces (F, 3), the number of bodies turned, and the number of bodies; an open rest counts as one body.
    """
    count = int(patch.max(initial=-1)) + 1
    vectors = area_vectors(vertices, faces)
    area = np.bincount(patch, np.linalg.norm(vectors, axis=1), count)
    resultant = np.stack([np.bincount(patch, vectors[:, axis], count) for axis in range(3)], axis=1)
    volume = signed_volumes(vertices, faces, patch, count)
    closed = closed_patches(faces, patch, count)
    closed |= np.linalg.norm(resultant, axis=1) < NEARLY_CLOSED * area
    bodies = np.flatnonzero(closed & (np.abs(volume) > 1e-9 * area**1.5))
    turn = np.zeros(count, bool)
    turn[bodies] = bodies_to_turn(vertices, faces, patch, bodies, volume[bodies])
    turned = int(turn.sum())
    is_open = np.ones(count, bool)
    is_open[bodies] = False
    rest = is_open[patch]
    if rest.any():
        corners = (vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2)[faces[rest]]
        if np.linalg.det(corners).sum() < 0:
            turn |= is_open
            turned += 1
    faces = np.where(turn[patch][:, None], faces[:, ::-1], faces)
    return faces, turned, len(bodies) + int(rest.any())


def closed_patches(faces: np.ndarray, patch: np.ndarray, count: int) -> np.ndarray:
    """Which patches (count,) have no open edge of their own."""
    keys, direction = directed_edges(faces)
    order = np.lexsort((keys, np.tile(patch, 3)))
    keys, direction, label = keys[order], direction[order], np.tile(patch, 3)[order]
    start = np.flatnonzero(np.concatenate([[True], (np.diff(keys) != 0) | (np.diff(label) != 0)]))
    unbalanced = np.add.reduceat(direction, start) != 0
    return np.bincount(label[start], unbalanced, count) == 0


def bodies_to_turn(
    vertices: np.ndarray, faces: np.ndarray, patch: np.ndarray, bodies: np.ndarray, volume: np.ndarray
) -> np.ndarray:
    """Which of the ``bodies`` (K,), as numbers of patches with a ``volume`` (K,), are inside out."""
    if (volume > 0).all():
        return np.zeros(len(bodies), bool)
    containers = nesting(vertices, faces, patch, bodies, volume)
    outward = np.ones(len(bodies), int)  # orientation at the end
    in_file = np.where(volume > 0, 1, -1)
    for body in np.argsort(-np.abs(volume)).tolist():
        around = containers[body]
        if not around:
            continue
        nearest = min(around, key=lambda other: abs(volume[other]))
        if sum(int(outward[other]) for other in around) > 0:
            outward[body] = in_file[body] * outward[nearest] * in_file[nearest]
    return outward != in_file


def nesting(
    vertices: np.ndarray, faces: np.ndarray, patch: np.ndarray, bodies: np.ndarray, volume: np.ndarray
) -> list[list[int]]:
    """For each of the ``bodies`` (K,) those that contain all of it, by their place in the list."""
    import igl

    order = np.argsort(patch, kind="stable")
    ends = np.searchsorted(patch[order], bodies, side="right")
    starts = np.searchsorted(patch[order], bodies, side="left")
    members = [faces[order[start:end]] for start, end in zip(starts, ends, strict=True)]
    lower = np.stack([vertices[own].min(axis=(0, 1)) for own in members])
    upper = np.stack([vertices[own].max(axis=(0, 1)) for own in members])
    containers: list[list[int]] = [[] for _ in members]
    inside: dict[int, list[int]] = {}
    for first in range(0, len(members), CHUNK):
        part = slice(first, first + CHUNK)
        within = (lower[part, None] >= lower).all(axis=2) & (upper[part, None] <= upper).all(axis=2)
        within &= np.abs(volume[part, None]) < np.abs(volume)
        for inner, outer in np.argwhere(within).tolist():
            inside.setdefault(outer, []).append(first + inner)
    for outer, nested in inside.items():
        winding = igl.FastWindingNumberBVH()
        winding.init(vertices, np.ascontiguousarray(members[outer]))
        for body in nested:
            corners = np.unique(members[body])
            sample = vertices[corners[:: max(1, len(corners) // SAMPLES)]]
            if (np.abs(winding.winding_number(np.ascontiguousarray(sample))) > 0.5).all():
                containers[body].append(outer)
    return containers
