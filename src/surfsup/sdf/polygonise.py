"""The zero set of a surface as triangles."""

from __future__ import annotations

import igl
import numpy as np
import torch
import trimesh

from surfsup.errors import InputError
from surfsup.sdf.surface import Surface

CHUNK = 200_000  # grid points a query: bounds the memory of the surface's own intermediate tensors


def to_mesh(surface: Surface, resolution: int = 96) -> trimesh.Trimesh:
    """Triangles of the zero set by marching cubes, vertices then moved onto the surface by Newton's method.

    Args:
        surface: what to polygonise.
        resolution: cells along the longest side of the surface's bounds.

    Returns:
        A mesh in metres, its faces turned outward; closed when the surface is.

    Raises:
        InputError: nothing of the solid is larger than a cell.
    """
    lower, upper = surface.bounds().detach().cpu().double().numpy()
    cell = float((upper - lower).max()) / resolution
    # The odd shift keeps flat faces off the grid points, where a value of exactly zero would split vertices.
    start = lower - 1.6180339 * cell
    axes = [np.arange(low, high + 2 * cell, cell) for low, high in zip(start, upper, strict=True)]
    # libigl wants x to run fastest.
    z, y, x = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    grid = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    values = evaluate(surface, grid)
    if values.min() >= 0:
        raise InputError(f"the surface has no inside that a grid of {cell:.3g} m cells could see; is it empty?")
    vertices, faces, *_ = igl.marching_cubes(values, grid, len(axes[0]), len(axes[1]), len(axes[2]), 0.0)
    for _ in range(2):
        vertices = vertices - newton_step(surface, vertices, largest=cell / 2)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    if mesh.volume < 0:
        mesh.invert()
    return mesh


def evaluate(surface: Surface, points: np.ndarray) -> np.ndarray:
    """Signed distances (N,) float64 of ``points`` (N, 3), a chunk at a time and without gradients."""
    device = surface.bounds().device
    with torch.no_grad():
        parts = [
            surface.distance(torch.as_tensor(chunk, dtype=torch.float32, device=device)).cpu().numpy()
            for chunk in np.array_split(points, max(1, len(points) // CHUNK))
        ]
    return np.concatenate(parts).astype(np.float64)


def newton_step(surface: Surface, vertices: np.ndarray, largest: float) -> np.ndarray:
    """How far (N, 3) each vertex lies off the surface, no part longer than ``largest``."""
    device = surface.bounds().device
    with torch.no_grad():
        distance, normal = surface.distance_and_normal(
            torch.as_tensor(vertices, dtype=torch.float32, device=device)
        )
    return (distance.clamp(-largest, largest)[:, None] * normal).cpu().numpy().astype(np.float64)
