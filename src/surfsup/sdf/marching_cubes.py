"""The zero set of a surface as triangles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from surfsup.errors import InputError

if TYPE_CHECKING:
    import trimesh

    from surfsup.sdf.surface import Surface

CHUNK = 200_000  # grid points per query; limits the memory of the surface's intermediate tensors


def polygonize(surface: Surface, resolution: int = 96) -> trimesh.Trimesh:
    """Triangles of the zero set: marching cubes, followed by two Newton steps that move vertices onto the surface.

    Args:
        surface: The surface to triangulate.
        resolution: Cells along the longest side of the surface's bounds.

    Returns:
        A mesh in meters with faces oriented outward; closed if the surface is.

    Raises:
        InputError: No part of the solid is larger than a cell.
    """
    import trimesh

    return trimesh.Trimesh(*zero_set(surface, resolution), process=False)


def zero_set(surface: Surface, resolution: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and faces (F, 3) of :func:`polygonize`, without the library of its mesh.

    Raises:
        InputError: No part of the solid is larger than a cell.
    """
    import igl

    lower, upper = surface.bounds().detach().cpu().double().numpy()
    if not (np.isfinite(lower).all() and np.isfinite(upper).all() and (lower < upper).all()):
        raise InputError("the surface is empty: the bounding boxes of its parts do not overlap")
    cell = float((upper - lower).max()) / resolution
    # An irrational shift keeps flat faces off the grid points, where values of exactly zero would duplicate vertices.
    start = lower - 1.6180339 * cell
    axes = [np.arange(low, high + 2 * cell, cell) for low, high in zip(start, upper, strict=True)]
    # libigl expects x to vary fastest.
    lattice = np.empty((len(axes[2]), len(axes[1]), len(axes[0]), 3))
    lattice[..., 0], lattice[..., 1] = axes[0], axes[1][:, None]
    lattice[..., 2] = axes[2][:, None, None]
    grid = lattice.reshape(-1, 3)
    values = np.concatenate([distances(surface, part) for part in chunks(grid)])
    if values.min() >= 0:
        raise InputError(f"the surface has no inside that a grid with cells of {cell:.3g} m resolves; is it empty?")
    vertices, faces, *_ = igl.marching_cubes(values, grid, len(axes[0]), len(axes[1]), len(axes[2]), 0.0)
    for _ in range(2):
        steps = [newton_step(surface, part, max_step=cell / 2) for part in chunks(vertices)]
        vertices = vertices - np.concatenate(steps)
    return vertices, np.ascontiguousarray(faces[:, ::-1]) if signed_volume(vertices, faces) < 0 else faces


def signed_volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """The volume that triangles enclose, m³; negative if they are oriented inward."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


def chunks(points: np.ndarray) -> list[np.ndarray]:
    """``points`` (N, 3) in parts of about CHUNK points."""
    return np.array_split(points, max(1, len(points) // CHUNK))


def distances(surface: Surface, points: np.ndarray) -> np.ndarray:
    """Signed distances (N,) float64 of ``points`` (N, 3), without gradients."""
    with torch.no_grad():
        values = surface.distance(as_query(surface, points))
    return values.cpu().numpy().astype(np.float64)


def newton_step(surface: Surface, vertices: np.ndarray, max_step: float) -> np.ndarray:
    """The displacement (N, 3) of each vertex from the surface, at most ``max_step`` long."""
    with torch.no_grad():
        distance, normal = surface.distance_and_normal(as_query(surface, vertices))
    return (distance.clamp(-max_step, max_step)[:, None] * normal).cpu().numpy().astype(np.float64)


def as_query(surface: Surface, points: np.ndarray) -> torch.Tensor:
    """``points`` in single precision on the device of the surface."""
    return torch.as_tensor(points, dtype=torch.float32, device=surface.bounds().device)
