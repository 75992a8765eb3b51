"""Sheets without thickness, found by the winding number."""

from __future__ import annotations

import numpy as np

from surfsup.sdf.mesh.topology import area_vectors, open_edges, parts_of

OPENNESS = 0.04  # mean distance of the winding number from an integer, above which a part is a sheet
LARGE = 0.01  # share of the area above which a part is evaluated by itself
SAMPLES = 256  # faces at which a part is evaluated
STEP = 1e-4  # distance over extent from a face at which the winding number is taken


def sheet_faces(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Which faces (F,) belong to a sheet: a part, open at an edge, that separates no inside from an outside.

    Just behind a face the winding number of a solid is an integer; small holes change it a little, the mouth of a cup
    much. The mean over a part, weighted by area, decides; it is taken at a sample of the faces.

    Args:
        vertices: (V, 3), with a largest extent of about one.
        faces: (F, 3), oriented consistently.
    """
    import igl

    if not open_edges(faces).any():
        return np.zeros(len(faces), bool)
    vectors = area_vectors(vertices, faces)
    area = np.linalg.norm(vectors, axis=1)
    part = parts_of(faces, len(vertices))
    size = np.bincount(part, area)
    small = size < LARGE * area.sum()
    part = np.unique(np.where(small[part], len(size), part), return_inverse=True)[1]  # the small parts together
    sample = sampled_faces(part, area)
    normals = vectors[sample] / np.maximum(area[sample], np.finfo(float).tiny)[:, None]
    winding = igl.FastWindingNumberBVH()
    winding.init(vertices, np.ascontiguousarray(faces))
    behind = winding.winding_number(np.ascontiguousarray(vertices[faces[sample]].mean(axis=1) - STEP * normals))
    openness = np.abs(behind - np.round(behind))
    mean = np.bincount(part[sample], openness) / np.bincount(part[sample])
    return (mean > OPENNESS)[part]


def sampled_faces(part: np.ndarray, area: np.ndarray) -> np.ndarray:
    """SAMPLES faces of each part, at equal steps of the accumulated area (F,), so that large faces come more often.

    A query takes up to 10 ms where large triangles intersect, so not every face can have one.
    """
    order = np.argsort(part, kind="stable")
    until = np.cumsum(area[order])
    ends = until[np.searchsorted(part[order], np.arange(part.max() + 1), side="right") - 1]
    starts = np.concatenate([[0.0], ends[:-1]])
    levels = starts[:, None] + (ends - starts)[:, None] * (np.arange(SAMPLES) + 0.5) / SAMPLES
    return order[np.minimum(np.searchsorted(until, levels.ravel()), len(order) - 1)]
