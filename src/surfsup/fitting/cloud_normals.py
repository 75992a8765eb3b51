"""Whether the normals of a point cloud can be its normals, measured before hours of fitting depend on them."""

from __future__ import annotations

import warnings

import numpy as np
from scipy.spatial import cKDTree

from surfsup.errors import InputError

SAMPLE = 4_000  # points at which the normals are compared with those of their neighborhood
NEIGHBORS = 8
MIN_ACROSS = (
    0.65  # mean |cosine| to the normal of the neighborhood: 0.5 for random directions, 0.9 and more for normals
)
MAX_OPPOSED = 0.3  # share of neighbors with opposite normals: 0.5 for random signs


class CloudWarning(UserWarning):
    """A point cloud is unusual; the message says how its fit will come out."""


def check_normals(points: np.ndarray, vectors: np.ndarray, source: str, remedy: str) -> None:
    """Compare the normals of a cloud with the points around them.

    Args:
        points: (N, 3).
        vectors: (N, 3) as the file has them, of any length.
        source: name of the cloud for messages.
        remedy: how to get normals, for messages.

    Raises:
        InputError: they are colors, do not stand across the surface, or point to either side at random.

    Warns:
        CloudWarning: they point inward as a whole, so that the solid is everything around the cloud.
    """
    if vectors.min() >= 0:
        raise InputError(
            f"{source}: its normals have no negative component, as colors have; on a solid they point in all "
            f"directions; {remedy}"
        )
    normals = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    chosen = np.linspace(0, len(points) - 1, min(SAMPLE, len(points))).astype(np.int64)
    distance, near = map(np.asarray, cKDTree(points).query(points[chosen], NEIGHBORS + 1))
    across, opposed = agreement(points, normals, chosen, near)
    if across < MIN_ACROSS:
        raise InputError(
            f"{source}: its normals do not stand across its surface: the mean cosine to the normal of the points "
            f"around is {across:.2f} (0.5 for random directions); {remedy}"
        )
    if opposed > MAX_OPPOSED:
        raise InputError(
            f"{source}: {100 * opposed:.0f} % of neighboring normals point to opposite sides, so they do not say where "
            f"the inside is; {remedy}"
        )
    area = distance[:, -1] ** 2
    if (area * ((points[chosen] - points.mean(axis=0)) * normals[chosen]).sum(axis=1)).sum() < 0:
        warnings.warn(
            f"{source}: its normals point inward as a whole, so the solid is everything around the cloud; "
            "turn them round (multiply them by -1) if it is the cloud itself",
            CloudWarning,
            stacklevel=2,
        )


def agreement(points: np.ndarray, normals: np.ndarray, chosen: np.ndarray, near: np.ndarray) -> tuple[float, float]:
    """Mean |cosine| of normals to those of the planes through their neighbors, and share of opposed neighbors.

    Args:
        points: (N, 3).
        normals: (N, 3) of length one.
        chosen: (M,) indices of the points to check.
        near: (M, K) indices of their neighbors, themselves first.
    """
    around = points[near] - np.mean(points[near], axis=1, keepdims=True)
    _, axes = np.linalg.eigh(around.transpose(0, 2, 1) @ around)
    across = np.abs((axes[:, :, 0] * normals[chosen]).sum(axis=1))
    cosines = (normals[near[:, 1:]] * normals[chosen, None]).sum(axis=-1)
    return float(across.mean()), float((cosines < 0).mean())
