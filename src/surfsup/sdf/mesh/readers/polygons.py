"""Polygons in space cut into triangles."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

FLAT_CORNER = 1e-9  # sine of a corner's angle, relative to the polygon's size, below which it counts as straight


def triangulate(vertices: np.ndarray, sizes: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Triangles (F, 3) of polygons, in their order.

    Convex polygons become fans around their first corner. Concave ones are projected along their normal and cut by
    ear clipping (the library earcut). A polygon keeps all its corners, so that it still meets its neighbors.

    Args:
        vertices: (V, 3).
        sizes: (P,) number of corners of each polygon; those with fewer than three are left out.
        corners: (sum of sizes,) indices of vertices. Polygons with an index out of range become fans.
    """
    sizes, corners = np.asarray(sizes, dtype=np.int64), np.asarray(corners, dtype=np.int64)
    first = np.cumsum(sizes) - sizes
    triangles, order = [np.empty((0, 3), np.int64)], [np.empty(0, np.int64)]
    for size in np.unique(sizes[sizes >= 3]).tolist():
        which = np.flatnonzero(sizes == size)
        polygons = corners[first[which, None] + np.arange(size)]
        if size > 3:
            polygons = alike(polygons)
        cut = fans(polygons)
        concave = np.flatnonzero(is_concave(vertices, polygons))
        for index in concave:
            cut[index] = clip_ears(vertices[polygons[index]], polygons[index])
        triangles.append(cut.reshape(-1, 3))
        order.append(np.repeat(which, size - 2))
    return np.concatenate(triangles)[np.argsort(np.concatenate(order), kind="stable")]


def alike(polygons: np.ndarray) -> np.ndarray:
    """``polygons`` (P, n), where those with the same corners begin at the same one.

    Then two bodies that share a face share its triangles.
    """
    _, group, count = np.unique(np.sort(polygons, axis=1), axis=0, return_inverse=True, return_counts=True)
    shared = np.flatnonzero(count[group.ravel()] > 1)
    start = polygons[shared].argmin(axis=1)
    polygons = polygons.copy()
    turned = (start[:, None] + np.arange(polygons.shape[1])) % polygons.shape[1]
    polygons[shared] = np.take_along_axis(polygons[shared], turned, axis=1)
    return polygons


def fans(polygons: np.ndarray) -> np.ndarray:
    """The triangles (P, n - 2, 3) of ``polygons`` (P, n) around their first corners."""
    count = polygons.shape[1] - 2
    first = np.repeat(polygons[:, :1], count, axis=1)
    return np.stack([first, polygons[:, 1:-1], polygons[:, 2:]], axis=-1)


def is_concave(vertices: np.ndarray, polygons: np.ndarray) -> np.ndarray:
    """Which of ``polygons`` (P, n) turn the other way at some corner, or turn around more than once."""
    valid = np.asarray(((polygons >= 0) & (polygons < len(vertices))).all(axis=1))
    points = vertices[np.where(valid[:, None], polygons, 0)]
    with np.errstate(invalid="ignore", over="ignore"):
        points = points - points[:, :1]
        normal = newell_normal(points)
        length = np.linalg.norm(normal, axis=-1)
        along = np.roll(points, -1, axis=1) - points
        turn = (np.cross(np.roll(along, 1, axis=1), along) * normal[:, None]).sum(axis=-1)
        reflex = (turn < -FLAT_CORNER * length[:, None] ** 2).any(axis=1)
        # A star turns the same way everywhere, but its triangles around one corner overlap.
        fan = (np.cross(points[:, 1:-1], points[:, 2:]) * normal[:, None]).sum(axis=-1)
        reflex |= (fan < -FLAT_CORNER * length[:, None] ** 2).any(axis=1)
    return np.asarray(valid & reflex)


def newell_normal(points: np.ndarray) -> np.ndarray:
    """The area vectors (..., 3) of polygons with corners ``points`` (..., n, 3), twice their area long."""
    return np.cross(points, np.roll(points, -1, axis=-2)).sum(axis=-2)


def clip_ears(points: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """The triangles (n - 2, 3) of one ``polygon`` (n,) with corners at ``points`` (n, 3)."""
    from mapbox_earcut import triangulate_float64

    points = points - points[0]
    normal = newell_normal(points)
    size = np.abs(points).max()
    if not (np.isfinite(normal).all() and np.linalg.norm(normal) > 0):
        return fans(polygon[None])[0]
    # Any two axes across the normal will do if they are right-handed with it.
    across = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    axes = np.stack([across, np.cross(normal, across)])
    flat = points / size @ (axes / np.linalg.norm(axes, axis=1, keepdims=True)).T
    local = triangulate_float64(np.ascontiguousarray(flat), np.array([len(flat)], np.uint32)).reshape(-1, 3)
    a, b, c = flat[local].transpose(1, 0, 2)
    turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles = np.where(turn[:, None] < 0, local[:, ::-1], local).astype(np.int64).tolist()
    restore_straight_corners(triangles, len(points))
    if len(triangles) != len(polygon) - 2:
        return fans(polygon[None])[0]
    return polygon[np.array(triangles)]


def restore_straight_corners(triangles: list[list[int]], count: int) -> None:
    """Put back the corners that ear clipping left out because they lie on a straight edge, by splitting triangles.

    Args:
        triangles: of corners 0 to ``count`` - 1, changed in place.
        count: corners of the polygon.
    """
    kept = sorted({corner for triangle in triangles for corner in triangle})
    if len(kept) < 3:
        return
    for start, end in zip(kept, [*kept[1:], kept[0] + count], strict=True):
        between = [corner % count for corner in range(start + 1, end)]
        if not between:
            continue
        edge = (start, end % count)
        for triangle in triangles:
            for turn in range(3):
                a, b, apex = triangle[turn], triangle[(turn + 1) % 3], triangle[(turn + 2) % 3]
                if (a, b) != edge:
                    continue
                triangles.remove(triangle)
                chain = [start, *between, end % count]
                triangles += [[p, q, apex] for p, q in pairwise(chain)]
                break
            else:
                continue
            break


def strip_triangles(strip: np.ndarray) -> np.ndarray:
    """The triangles (F, 3) of a triangle ``strip`` (n,); a negative index starts a new strip."""
    pieces = np.split(strip, np.flatnonzero(strip < 0))
    triangles = [np.empty((0, 3), np.int64)]
    for piece in pieces:
        run = piece[piece >= 0]
        if len(run) < 3:
            continue
        cut = np.stack([run[:-2], run[1:-1], run[2:]], axis=1)
        cut[1::2] = cut[1::2, ::-1]
        triangles.append(cut)
    return np.concatenate(triangles)
