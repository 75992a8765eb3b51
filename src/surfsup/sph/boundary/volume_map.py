"""Boundary volume maps: the signed distance to a solid and the volume that it takes up around a point, on a grid.

Method: Bender et al., "Volume Maps: An Implicit Boundary Representation for SPH" (2019). SPlisHSPlasH builds its maps
from triangles, with a quadrature of 27,000 points for each node. Here they are built from the signed distance itself.
Triangles round nothing off, and the volume integral is a convolution with a ball, which takes two Fourier transforms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from surfsup.errors import InputError
from surfsup.memory import available_memory
from surfsup.sdf import Surface
from surfsup.sph.boundary.density import VOLUME_FACTOR
from surfsup.sph.boundary.shape_functions import CELL_NODES, OTHER_POINTS, STEPS_PER_CELL, interpolation_matrix
from surfsup.sph.kernels import KERNEL_SUPPORT

SERIES_LIMIT = 0.1  # below this phase over the kernel support, the Fourier transform of the ball is a series
BYTES_PER_CELL = 1000  # while a map is built; 900 measured at 5.8 million cells
QUERY_SIZE = 250_000  # points per query, which bounds the memory of the surface's intermediate tensors


@dataclass(frozen=True)
class VolumeMap:
    """A grid over a box. Only the cells near the surface have nodes.

    Attributes:
        lower: lowest corner of the box (3,), meters.
        cell: sides of a cell (3,), meters.
        resolution: number of cells along x, y and z (3,).
        cells: indices (M,) of the cells that have nodes; x varies fastest.
        cell_nodes: node indices (M, 32) of these cells.
        distances: signed distance (K,) at each node, meters, negative inside the solid.
        volumes: boundary volume (K,) at each node, m³, with the factor of SPlisHSPlasH.
    """

    lower: np.ndarray
    cell: np.ndarray
    resolution: np.ndarray
    cells: np.ndarray
    cell_nodes: np.ndarray
    distances: np.ndarray
    volumes: np.ndarray


def build_volume_map(
    surface: Surface, lower: np.ndarray, upper: np.ndarray, cell: np.ndarray, depth: float = KERNEL_SUPPORT
) -> VolumeMap:
    """Build the volume map of ``surface`` in the box from ``lower`` to ``upper`` (3,).

    Args:
        surface: its value must be the true distance outside the solid; inside it may be a bound.
        lower: lowest corner of the box in meters, at least a kernel support beyond any particle.
        upper: highest corner; it moves outward to a whole number of cells.
        cell: sides of a cell (3,), meters.
        depth: cells have nodes down to this depth inside the solid, meters.

    Raises:
        NoSurfaceNear: the surface has no point in the box.
        InputError: the map would take more memory than is free.
    """
    if (upper <= lower).any():
        raise no_surface_error()
    resolution = np.ceil((upper - lower) / cell - 1e-6).astype(int)
    padding = np.ceil(KERNEL_SUPPORT / cell).astype(int)  # cells around the box that the volume integral reaches
    padded = resolution + 2 * padding
    require_memory(resolution, padding)
    start = lower - padding * cell
    center_distances = cell_center_distances(surface, start, cell, padded, depth)
    near = near_surface(center_distances, cell, depth)
    if not near.any():
        raise no_surface_error()
    distances = lattice_distances(surface, start, cell, padded, center_distances, near)
    volumes = boundary_volumes(distances, cell / STEPS_PER_CELL)

    cells = cell_coordinates(np.flatnonzero(near), padded) - padding
    cells = cells[((cells >= 0) & (cells < resolution)).all(axis=1)]
    steps = STEPS_PER_CELL * (cells[:, None] + padding) + CELL_NODES
    lattice_indices, nodes = unique_with_inverse(
        np.ravel_multi_index(tuple(steps.reshape(-1, 3).T), distances.shape), distances.size
    )
    return VolumeMap(
        lower=np.asarray(lower, dtype=np.float64),
        cell=np.asarray(cell, dtype=np.float64),
        resolution=resolution,
        cells=cells @ np.array([1, resolution[0], resolution[0] * resolution[1]]),
        cell_nodes=nodes.reshape(-1, len(CELL_NODES)),
        distances=distances.ravel()[lattice_indices],
        volumes=volumes.ravel()[lattice_indices],
    )


def near_surface(center_distances: np.ndarray, cell: np.ndarray, depth: float) -> np.ndarray:
    """Which cells may contain points that need nodes, from the distances at the cell centers.

    Within a cell the distance differs from that at its center by at most half the cell's diagonal.
    """
    half_diagonal = np.linalg.norm(cell) / 2
    return (center_distances < KERNEL_SUPPORT + half_diagonal) & (center_distances > -depth - half_diagonal)


def cell_center_distances(
    surface: Surface, start: np.ndarray, cell: np.ndarray, cells: np.ndarray, depth: float
) -> np.ndarray:
    """Distance at the center of each cell, x fastest. Cells far from the surface share that of a block of cells.

    Distance queries far from a mesh are its slowest.
    """
    distances = np.zeros(int(cells.prod()))
    coordinates = cell_coordinates(np.arange(len(distances)), cells)
    open_cells = np.ones(len(distances), dtype=bool)
    for size in (8, 4, 2, 1):
        blocks = -(-cells // size)
        indices, inverse = unique_with_inverse(
            np.ravel_multi_index(tuple(coordinates[open_cells].T // size), blocks), int(blocks.prod())
        )
        centers = np.stack(np.unravel_index(indices, blocks), axis=1) + 0.5
        distances[open_cells] = signed_distances(surface, start + size * cell * centers)[inverse]
        open_cells &= near_surface(distances, size * cell, depth)
    return distances


def unique_with_inverse(indices: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The sorted unique values of ``indices`` (N,), all below ``count``, and the rank (N,) of each index among them.

    Same as ``numpy.unique(indices, return_inverse=True)``, without sorting millions of values.
    """
    present = np.zeros(count, dtype=bool)
    present[indices] = True
    return np.flatnonzero(present), (np.cumsum(present) - 1)[indices]


class NoSurfaceNear(InputError):
    """A surface that no particle can reach."""


def no_surface_error() -> NoSurfaceNear:
    """The error for a surface that no particle can reach."""
    return NoSurfaceNear("the surface has no point near the container; move it, or leave it out")


def require_memory(resolution: np.ndarray, padding: np.ndarray) -> None:
    """Refuse a map of so many cells, with ``padding`` (3,) on both sides, that this machine has no memory for it.

    Raises:
        InputError: with the factor by which larger particles would make it small enough.
    """

    def needed(factor: float) -> float:
        return BYTES_PER_CELL * float(np.prod(np.ceil(resolution / factor) + 2.0 * padding))

    free = available_memory()
    if needed(1.0) > free:
        factor = next(factor for factor in 1.05 ** np.arange(1, 500) if needed(factor) < free)
        sides = " x ".join(f"{count:,}" for count in resolution.tolist())
        raise InputError(
            f"the boundary map of the solid has {sides} cells, for which this machine has too little memory "
            f"({needed(1.0) / 1e9:.3g} GB, {free / 1e9:.2g} are free); a particle_radius {1.05 * factor:.2g} times as "
            "large would fit, or a smaller container or solid"
        )


def cell_coordinates(indices: np.ndarray, resolution: np.ndarray) -> np.ndarray:
    """Coordinates (M, 3) along x, y and z of the cells with ``indices`` (M,) in a grid where x varies fastest."""
    z, y, x = np.unravel_index(indices, tuple(resolution[::-1]))
    return np.stack([x, y, z], axis=1)


def signed_distances(surface: Surface, points: np.ndarray) -> np.ndarray:
    """Signed distances (N,) of ``points`` (N, 3), meters."""
    parts = np.array_split(points.astype(np.float32), max(1, len(points) // QUERY_SIZE))
    with torch.no_grad():
        return np.concatenate([surface.distance(torch.from_numpy(part)).numpy() for part in parts])


def lattice_distances(
    surface: Surface,
    start: np.ndarray,
    cell: np.ndarray,
    cells: np.ndarray,
    center_distances: np.ndarray,
    near: np.ndarray,
) -> np.ndarray:
    """Distances (X, Y, Z) on the lattice of all possible nodes.

    In cells near the surface the nodes have exact distances and the lattice's other points interpolated ones, which
    saves three quarters of the queries. Elsewhere the volume integral needs only the sign, and the lattice takes the
    distance at the cell's center.

    Args:
        surface: the solid.
        start: lowest corner of the grid (3,), meters.
        cell: sides of a cell (3,), meters.
        cells: number of cells along x, y and z (3,).
        center_distances: distance at the center of each cell, x fastest.
        near: which cells are near the surface, x fastest.
    """
    shape = STEPS_PER_CELL * cells + 1
    far = np.where(near, 0.0, center_distances).reshape(cells[::-1]).transpose(2, 1, 0)
    lattice = np.empty(shape, dtype=np.float32)
    lattice[:-1, :-1, :-1] = far.repeat(STEPS_PER_CELL, 0).repeat(STEPS_PER_CELL, 1).repeat(STEPS_PER_CELL, 2)
    lattice[-1, :, :], lattice[:, -1, :], lattice[:, :, -1] = lattice[-2], lattice[:, -2], lattice[:, :, -2]

    is_node = np.zeros(shape, dtype=bool)
    corners = STEPS_PER_CELL * cell_coordinates(np.flatnonzero(near), cells)
    for step in CELL_NODES:
        is_node[tuple((corners + step).T)] = True
    lattice[is_node] = signed_distances(surface, start + cell / STEPS_PER_CELL * np.argwhere(is_node))
    nodes = lattice[tuple((corners[:, None] + CELL_NODES).reshape(-1, 3).T)].reshape(-1, len(CELL_NODES))
    others = nodes @ interpolation_matrix().T.astype(np.float32)
    lattice[tuple((corners[:, None] + OTHER_POINTS).reshape(-1, 3).T)] = others.ravel()
    return lattice


def boundary_volumes(distances: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """The boundary volume (X, Y, Z) in m³ at each lattice point: the integral of γ over a ball of the kernel support.

    The lattice points are ``spacing`` (3,) meters apart. The integral over a ball is a product in Fourier space, where
    the ball has a closed form.
    """
    from scipy import fft

    weight = extension(distances)
    reach = np.ceil(KERNEL_SUPPORT / spacing).astype(int)
    # The padding repeats the edge of the lattice and keeps the ball from wrapping around.
    padded = np.pad(weight, reach[:, None], mode="edge")
    shape = [fft.next_fast_len(side, real=True) for side in padded.shape]
    # Single precision is four times as fast as double. Its error is a millionth of the largest volume.
    x, y = (2 * np.pi * fft.fftfreq(shape[axis], spacing[axis]).astype(np.float32) for axis in (0, 1))
    z = 2 * np.pi * fft.rfftfreq(shape[2], spacing[2]).astype(np.float32)
    frequency = np.sqrt(x[:, None, None] ** 2 + y[:, None] ** 2 + z**2)
    spectrum = fft.rfftn(padded, shape) * ball_spectrum(frequency)
    convolved = fft.irfftn(spectrum, shape)
    inner = tuple(slice(before, before + side) for before, side in zip(reach, distances.shape, strict=True))
    ball = 4 / 3 * np.pi * KERNEL_SUPPORT**3
    return VOLUME_FACTOR * convolved[inner].clip(0, ball)


def extension(distances: np.ndarray) -> np.ndarray:
    """The function γ of Bender et al.: 1 inside the solid, W(d) / W(0) at a distance d outside."""
    q = distances.clip(0, KERNEL_SUPPORT) / KERNEL_SUPPORT
    # surfsup.sph.kernels.cubic_spline in the order of operations that existing maps were rounded with.
    return np.where(q <= 0.5, 6 * q**3 - 6 * q**2 + 1, 2 * (1 - q) ** 3)


def ball_spectrum(frequency: np.ndarray) -> np.ndarray:
    """Fourier transform of a ball of the kernel support at angular ``frequency`` (rad/m), in m³."""
    phase = frequency * KERNEL_SUPPORT
    # At low frequencies the difference cancels in single precision, which would add a few hundredths of the ball to
    # every volume. The series replaces it there.
    clipped = np.maximum(phase, SERIES_LIMIT)
    closed_form = (np.sin(clipped) - clipped * np.cos(clipped)) / clipped**3
    return 4 * np.pi * KERNEL_SUPPORT**3 * np.where(phase < SERIES_LIMIT, 1 / 3 - phase**2 / 30, closed_form)
