"""How the solver feels a solid: its distance and the solid's share of a particle's neighborhood, on a grid.

The method is that of Bender et al., "Volume Maps: An Implicit Boundary Representation for SPH" (2019). SPlisHSPlasH
builds such maps from triangles, by a quadrature of 27,000 points a node. We build them from the signed distance
itself: nothing is rounded off by triangles, and the integral, being a convolution with a ball, costs two Fourier
transforms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from scipy import fft

from surfsup.errors import InputError
from surfsup.sdf import Surface
from surfsup.sph.boundary.shape_functions import NODES_A_SIDE, NODES_OF_CELL, OTHERS_OF_CELL, from_nodes_to_others
from surfsup.sph.kernels import KERNEL_SUPPORT

VOLUME_FACTOR = 0.8  # of the solver's volume maps
SLOW = 0.1  # a wave's phase over the support radius up to which its series is the better way
CHUNK = 250_000  # points a query, which bounds the memory of the surface's own intermediate tensors


@dataclass(frozen=True)
class VolumeMap:
    """A grid over a box, with nodes only in the cells that the solver needs: those near the surface.

    Attributes:
        lower: the box's lowest corner (3,), meters.
        cell: sides of a cell (3,), meters.
        resolution: cells along x, y and z (3,).
        kept: numbers (M,) of the cells that have nodes; x runs fastest.
        nodes: (M, 32) which nodes a kept cell has.
        distances: (K,) of the nodes, meters, negative inside the solid.
        volumes: (K,) of solid around the nodes, m³, as the solver weighs it.
    """

    lower: np.ndarray
    cell: np.ndarray
    resolution: np.ndarray
    kept: np.ndarray
    nodes: np.ndarray
    distances: np.ndarray
    volumes: np.ndarray


def volume_map(
    surface: Surface, lower: np.ndarray, upper: np.ndarray, cell: np.ndarray, depth: float = KERNEL_SUPPORT
) -> VolumeMap:
    """The map of ``surface`` in the box from ``lower`` to ``upper`` (3,), in cells of the sides ``cell`` (3,).

    Args:
        surface: its value outside must be the distance, and may be less than it only inside.
        lower: lowest corner of the box in meters; it must reach a support radius beyond where particles go.
        upper: highest corner; moved outward to whole cells.
        cell: sides of a cell, meters.
        depth: how far into the solid cells have nodes, meters.

    Raises:
        InputError: the surface has no point in the box.
    """
    if (upper <= lower).any():
        raise nothing_to_feel()
    resolution = np.ceil((upper - lower) / cell - 1e-6).astype(int)
    around = np.ceil(KERNEL_SUPPORT / cell).astype(int)  # cells beyond the box which the integral reaches into
    padded = resolution + 2 * around
    start = lower - around * cell
    middles = middle_distances(surface, start, cell, padded, depth)
    near = may_be_near(middles, cell, depth)
    if not near.any():
        raise nothing_to_feel()
    distances = lattice_distances(surface, start, cell, padded, middles, near)
    volumes = solid_around(distances, cell / NODES_A_SIDE)

    inside_box = indices_of(np.flatnonzero(near), padded) - around
    inside_box = inside_box[((inside_box >= 0) & (inside_box < resolution)).all(axis=1)]
    steps = NODES_A_SIDE * (inside_box[:, None] + around) + NODES_OF_CELL
    places, nodes = each_once(np.ravel_multi_index(tuple(steps.reshape(-1, 3).T), distances.shape), distances.size)
    return VolumeMap(
        lower=np.asarray(lower, dtype=np.float64),
        cell=np.asarray(cell, dtype=np.float64),
        resolution=resolution,
        kept=inside_box @ np.array([1, resolution[0], resolution[0] * resolution[1]]),
        nodes=nodes.reshape(-1, len(NODES_OF_CELL)),
        distances=distances.ravel()[places],
        volumes=volumes.ravel()[places],
    )


def may_be_near(middles: np.ndarray, cell: np.ndarray, depth: float) -> np.ndarray:
    """Which cells, by the distances at their middles, may have points near the surface.

    Whatever the distance at its middle, within a cell it changes by no more than the way to the corner.
    """
    reach = np.linalg.norm(cell) / 2
    return (middles < KERNEL_SUPPORT + reach) & (middles > -depth - reach)


def middle_distances(
    surface: Surface, start: np.ndarray, cell: np.ndarray, cells: np.ndarray, depth: float
) -> np.ndarray:
    """The distance at the middle of every cell, x fastest; of cells that are far, at that of a block of cells.

    To ask of what is far takes a mesh longest.
    """
    middles = np.zeros(int(cells.prod()))
    inside = indices_of(np.arange(len(middles)), cells)
    asked = np.ones(len(middles), dtype=bool)
    for size in (8, 4, 2, 1):
        blocks = -(-cells // size)
        numbers, of = each_once(np.ravel_multi_index(tuple(inside[asked].T // size), blocks), int(blocks.prod()))
        middle = np.stack(np.unravel_index(numbers, blocks), axis=1) + 0.5
        middles[asked] = distance_at(surface, start + size * cell * middle)[of]
        asked &= may_be_near(middles, size * cell, depth)
    return middles


def each_once(numbers: np.ndarray, below: int) -> tuple[np.ndarray, np.ndarray]:
    """All ``numbers`` (N,) from 0 to ``below``, each once and in order, and where each of the N is among them.

    What ``numpy.unique`` does, without sorting millions.
    """
    there = np.zeros(below, dtype=bool)
    there[numbers] = True
    return np.flatnonzero(there), (np.cumsum(there) - 1)[numbers]


def nothing_to_feel() -> InputError:
    """The complaint about a surface that no particle can meet."""
    return InputError("the surface has no point near the container; move it, or leave it out")


def indices_of(numbers: np.ndarray, resolution: np.ndarray) -> np.ndarray:
    """Column, row and layer (M, 3) of the cells ``numbers`` (M,) of a grid in which x runs fastest."""
    z, y, x = np.unravel_index(numbers, tuple(resolution[::-1]))
    return np.stack([x, y, z], axis=1)


def distance_at(surface: Surface, points: np.ndarray) -> np.ndarray:
    """Signed distances (N,) of ``points`` (N, 3)."""
    parts = np.array_split(points.astype(np.float32), max(1, len(points) // CHUNK))
    with torch.no_grad():
        return np.concatenate([surface.distance(torch.from_numpy(part)).numpy() for part in parts])


def lattice_distances(
    surface: Surface, start: np.ndarray, cell: np.ndarray, cells: np.ndarray, middles: np.ndarray, near: np.ndarray
) -> np.ndarray:
    """Distances (X, Y, Z) on the lattice of all possible nodes, in cells that are ``near`` as the solver knows them.

    There they are exact at the nodes, and in between as cells interpolate: the surface is asked a quarter as often.
    Elsewhere it is enough to know inside from outside, which the cell's middle tells.

    Args:
        surface: the solid.
        start: lowest corner of the grid.
        cell: sides of a cell (3,), meters.
        cells: how many along x, y and z.
        middles: distance at the middle of every cell, x fastest.
        near: whether the surface is close, for every cell.
    """
    shape = NODES_A_SIDE * cells + 1
    far = np.where(near, 0.0, middles).reshape(cells[::-1]).transpose(2, 1, 0)
    lattice = np.empty(shape, dtype=np.float32)
    block = far.repeat(NODES_A_SIDE, 0).repeat(NODES_A_SIDE, 1).repeat(NODES_A_SIDE, 2)
    lattice[:-1, :-1, :-1] = block
    lattice[-1, :, :], lattice[:, -1, :], lattice[:, :, -1] = lattice[-2], lattice[:, -2], lattice[:, :, -2]

    wanted = np.zeros(shape, dtype=bool)
    corners = NODES_A_SIDE * indices_of(np.flatnonzero(near), cells)
    for step in NODES_OF_CELL:
        wanted[tuple((corners + step).T)] = True
    lattice[wanted] = distance_at(surface, start + cell / NODES_A_SIDE * np.argwhere(wanted))
    nodes = lattice[tuple((corners[:, None] + NODES_OF_CELL).reshape(-1, 3).T)].reshape(-1, len(NODES_OF_CELL))
    others = nodes @ from_nodes_to_others().T.astype(np.float32)
    lattice[tuple((corners[:, None] + OTHERS_OF_CELL).reshape(-1, 3).T)] = others.ravel()
    return lattice


def solid_around(distances: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """The volume (X, Y, Z) in m³ that the solver sees within a support radius of every lattice point.

    Inside the solid counts whole; outside less and less, as the smoothing kernel falls off with the distance. The
    points are ``spacing`` (3,) meters apart.
    The integral over a ball is a product in Fourier space, where the ball is known in closed form.
    """
    weight = extension(distances)
    reach = np.ceil(KERNEL_SUPPORT / spacing).astype(int)
    # What lies beyond the lattice is like its edge, and the room must be wide enough for the ball not to wrap around.
    padded = np.pad(weight, reach[:, None], mode="edge")
    shape = [fft.next_fast_len(side, real=True) for side in padded.shape]
    # Single precision is four times as fast as double, and off by a millionth of the largest volume.
    x, y = (2 * np.pi * fft.fftfreq(shape[axis], spacing[axis]).astype(np.float32) for axis in (0, 1))
    z = 2 * np.pi * fft.rfftfreq(shape[2], spacing[2]).astype(np.float32)
    frequency = np.sqrt(x[:, None, None] ** 2 + y[:, None] ** 2 + z**2)
    spectrum = fft.rfftn(padded, shape) * ball_spectrum(frequency)
    whole = fft.irfftn(spectrum, shape)
    inner = tuple(slice(before, before + side) for before, side in zip(reach, distances.shape, strict=True))
    largest = 4 / 3 * np.pi * KERNEL_SUPPORT**3
    return VOLUME_FACTOR * whole[inner].clip(0, largest)


def extension(distances: np.ndarray) -> np.ndarray:
    """The function γ of Bender et al.: 1 inside the solid, W(d) / W(0) at a distance d outside."""
    q = distances.clip(0, KERNEL_SUPPORT) / KERNEL_SUPPORT
    # surfsup.sph.kernels.cubic_spline in the order of operations that existing maps were rounded with.
    return np.where(q <= 0.5, 6 * q**3 - 6 * q**2 + 1, 2 * (1 - q) ** 3)


def ball_spectrum(frequency: np.ndarray) -> np.ndarray:
    """Fourier transform of a ball of the support radius at angular ``frequency`` (rad/m), in m³."""
    reach = frequency * KERNEL_SUPPORT
    # Of slow waves little is left of the difference, in single precision nothing: that would add a few hundredths of
    # the ball to every volume.
    whole = np.maximum(reach, SLOW)
    share = np.where(reach < SLOW, 1 / 3 - reach**2 / 30, (np.sin(whole) - whole * np.cos(whole)) / whole**3)
    return 4 * np.pi * KERNEL_SUPPORT**3 * share
