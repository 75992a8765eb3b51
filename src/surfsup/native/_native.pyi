"""What module.cpp shows; matrices are as torch keeps them, a row an output."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

Matrix = Bias = Vectors = Values = Vector = np.ndarray
# Table (X Y Z, 4), first node, middle, cell, nodes (X, Y, Z): see surfsup.sdf.mesh.distance_cache.DistanceCache.
Grid = tuple[np.ndarray, tuple[float, ...], tuple[float, ...], float, tuple[int, ...]]
# A solid, or who writes the distance (N,) and, unless that is None, the unit normal (N, 3) of points (N, 3).
Asked: TypeAlias = "Solid | Callable[[Vectors, Values, Vectors | None], None]"

def instruction_sets() -> list[str]:
    """Instruction sets that this processor has and the step is compiled for, the fastest first."""

def find_pairs(
    positions: Vectors, radius: float, max_edges: int, threads: int
) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
    """All ordered pairs within ``radius``: how many, starts (N + 1,), receivers (E,), senders (E,), all int64.

    Where there are more than ``max_edges`` it stops, where a position is not finite the number is -1; then the arrays
    are empty.

    Raises:
        MemoryError: they do not fit into memory.
    """

def energy_gain(
    positions: Vectors, velocities: Vectors, new_positions: Vectors, new_velocities: Vectors, gravity: Vector
) -> float:
    """How much mechanical energy a step adds, mean J/kg; all but ``gravity`` (3,) are (N, 3)."""

def resolve_collisions(
    before: Vectors,
    positions: Vectors,
    velocities: Vectors,
    moved: np.ndarray,
    lower: Vector,
    upper: Vector,
    clearance: tuple[float, float, int],
    solid: Asked | None,
    last: tuple[Vectors, Values] | None,
    isa: str,
    threads: int,
) -> None:
    """The guard, see :func:`surfsup.sph.collision.guard`, in place; mark whom it ``moved`` (N,).

    Args:
        before: (N, 3) one frame earlier.
        positions, velocities: (N, 3).
        lower, upper: (3,), corners of the container.
        clearance: meters from walls and solid that they get, and short of it that they may stay, and how often they are
            pushed at most.
        solid: whom to ask.
        last: places (N, 3) where they were ``distance`` (N,) from the solid; without it all are looked at.
        isa: the instruction set to look at it with.
        threads: at most.

    Raises:
        ValueError: sizes do not fit, or the processor lacks the instruction set.
    """

def convolve(
    starts: np.ndarray,
    senders: np.ndarray,
    kernels: np.ndarray,
    hidden: Matrix,
    mix: Matrix,
    own: Matrix,
    out: Matrix,
    threads: int,
) -> None:
    """Write own h_i + sum_j sum_m k_m(i, j) mix_m h_j to ``out`` (N, C).

    Of h_j only as many channels count as ``mix`` (4C, M) has columns; C and M are multiples of 16.

    Raises:
        ValueError: sizes do not fit.
    """

def convolve_back(
    starts: np.ndarray,
    senders: np.ndarray,
    kernels: np.ndarray,
    hidden: Matrix,
    mix: Matrix,
    own: Matrix,
    gradient: Matrix,
    to_hidden: Matrix | None,
    to_mix: Matrix,
    to_own: Matrix,
    threads: int,
) -> None:
    """Write the gradients in what goes into :func:`convolve` from the ``gradient`` in its result.

    Raises:
        ValueError: sizes do not fit.
    """

def sum_fours(
    starts: np.ndarray, senders: np.ndarray, kernels: np.ndarray, values: np.ndarray, sums: np.ndarray, threads: int
) -> None:
    """Write sum_j k_m(i, j) v_j of four values a particle to ``sums`` (N, 4, 4)."""

def sum_fours_back(
    starts: np.ndarray,
    senders: np.ndarray,
    kernels: np.ndarray,
    gradient: np.ndarray,
    to_values: np.ndarray,
    threads: int,
) -> None:
    """Write the gradient in the values of :func:`sum_fours` from that in its sums."""

def sample(grid: Grid, points: np.ndarray, distance: np.ndarray, gradient: np.ndarray, threads: int) -> None:
    """Write what :meth:`surfsup.sdf.mesh.distance_cache.DistanceCache.sample` tells of ``points`` (N, 3) float64 in the grid.

    Raises:
        ValueError: sizes do not fit.
    """

class Triangles:
    """Triangles in a tree of boxes, copied."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        """Build the tree of vertices (V, 3) float64 and faces (F, 3) int64.

        Raises:
            IndexError: a face has a corner that there is not, or there is none.
        """

    def nearest(
        self,
        points: np.ndarray,
        at_most: np.ndarray | None,
        distance: np.ndarray,
        face: np.ndarray,
        closest: np.ndarray,
        threads: int,
    ) -> None:
        """Write distance (N,), face (N,) int64 and nearest place (N, 3) of ``points`` (N, 3), all else float64.

        ``at_most`` (N,) may say how far the nearest triangle can be: the less, the faster.

        Raises:
            ValueError: sizes do not fit.
        """

class Solid:
    """A solid whose distance has a closed form or is known by a network or a mesh; ``parts`` are copied."""

    def __init__(self, kind: str, numbers: list[float], parts: list[Solid]) -> None:
        """Check the kind and what it is made of.

        Raises:
            ValueError: there is no such kind, or it has other numbers or parts.
        """

    @staticmethod
    def of_network(
        *,
        layers: list[tuple[Matrix | None, Matrix | None, list[Bias], Matrix | None]],
        last: Values,
        last_bias: Values,
        code: Values | None,
        frequency: float,
        octaves: int,
        lattice: tuple[np.ndarray, tuple[float, ...], float, tuple[int, ...]] | None,
        near: float,
    ) -> Solid:
        """One that a network knows, in its own frame; all arrays are float32, and all but the lattice's are copied.

        Args:
            layers, last, last_bias, code, frequency, octaves: see :class:`surfsup.sdf.neural.native_layers.NativeLayers`.
            lattice: a table (X Y Z, 4) as of :class:`surfsup.sdf.grid.Lattice`, its first node, cell, (X, Y, Z).
            near: distance by the lattice up to which the network is asked.

        Raises:
            ValueError: they do not fit each other.
        """

    @staticmethod
    def of_mesh(
        *,
        triangles: Triangles,
        fine: Grid,
        coarse: Grid,
        unsigned_distance: np.ndarray,
        inside: np.ndarray,
        near: float,
        agree: float,
        touching: float,
        rest: Callable[[Vectors, Values, Vectors], None],
    ) -> Solid:
        """One that triangles enclose; no array is copied.

        Args:
            triangles: asked near the surface.
            fine: the grid around them.
            coarse: the one around that.
            unsigned_distance: (N,) float64 of the fine grid's nodes.
            inside: (N,) bool, whether they are.
            near: distance by the grid up to which the triangles are asked, meters.
            agree: length of the mean of the nodes' normals below which they are asked, too.
            touching: meters from the surface up to which rounding decides where the normal points.
            rest: writes distance and normal of points so near to the surface that the grid does not tell their side.

        Raises:
            ValueError: sizes do not fit.
        """

    def look(self, points: Vectors, distance: Values, normal: Vectors | None, isa: str, threads: int) -> None:
        """Write the signed distance (N,) and, where wanted, the unit normal (N, 3) of ``points`` (N, 3), all float32.

        Raises:
            ValueError: sizes do not fit, or the processor lacks the instruction set.
        """

class SolidMap:
    """A solid's distance and share in cubic cells; the tables are copied."""

    def __init__(
        self, lower: Vector, cell: Vector, resolution: np.ndarray, places: np.ndarray, nodes: np.ndarray
    ) -> None:
        """Copy the tables of :class:`surfsup.sph.boundary.map_interpolation.Tables`.

        Raises:
            ValueError: sizes do not fit, or a cell has nodes that are not there.
        """

class Network:
    """The convolution's network, which reads its weights anew in every step, and the memory of its steps."""

    def __init__(
        self,
        *,
        encoder: Matrix,
        factors: tuple[Matrix, Bias, Matrix, Bias],
        layers: list[tuple[Matrix, Matrix, Matrix]],
        decoder: tuple[Matrix, Matrix],
        solids: tuple[Values, float, float, float, float, float, float, float, float],
        radius: float,
        frame_time: float,
        displacement_scale: float,
        velocity_scale: float,
        slope_scale: float,
        density_scale: float,
        own_density: float,
        steps: int,
        of_rise: float,
        of_excess: float,
        slow: float,
        least: float,
        most_dense: float,
        viscosity: float,
        softened: float,
        pressure_scale: float,
        position_share: float,
        largest: float,
        thickest: tuple[float, ...],
    ) -> None:
        """Keep the weights' memory.

        Raises:
            ValueError: sizes do not fit.
        """

    def next_frame(
        self,
        positions: Vectors,
        velocities: Vectors,
        around: tuple[Vector, Vector, Vector],
        map: SolidMap | None,
        turn: Matrix,
        solid: Asked | None,
        clearance: tuple[float, float, int],
        handle_collisions: bool,
        most_gain: float,
        last: tuple[Vectors, Values],
        reached: tuple[Vectors, Vectors, np.ndarray],
        isa: str,
        threads: int,
        max_edges: int,
    ) -> tuple[int, bool]:
        """Write the positions, the velocities of the next frame, and whom the guard moved; in float32 and bool.

        Args:
            positions, velocities: (N, 3).
            around: gravity and the corners of the container, (3,) each.
            map: of the solid.
            turn: (3, 3), how it is turned.
            solid: whom to ask how far it is.
            clearance: as of :func:`guard`.
            handle_collisions: whether the guard is to be done.
            most_gain: J/kg that the frame may gain on the mean.
            last: places (N, 3) from where each particle looked at the solid last, and how far it was from there (N,).
                Whoever may have come near looks again: then both are those of this time. A distance is believed half.
            reached: (N, 3), (N, 3) and (N,), what is written.
            isa: the instruction set.
            threads: at most.
            max_edges: with more than that it stops.

        Returns:
            The number of edges, -1 where ballistic motion leads to what is not finite, and whether it is done: where
            more energy would be gained it has not been guarded yet.

        Raises:
            ValueError: sizes do not fit, or the processor lacks the instruction set.
            MemoryError: the neighbors do not fit into memory.
        """

    def observe(
        self,
        positions: Vectors,
        velocities: Vectors,
        ahead: Vectors,
        distance: Values,
        normal: Vectors,
        gravity: Vector,
        lower: Vector,
        upper: Vector,
        map: SolidMap | None,
        turn: Matrix,
        acts: Matrix,
        lie: Matrix,
        faster: Vectors,
        farther: Vectors,
        slope: Vectors,
        places: Vectors,
        isa: str,
        threads: int,
        max_edges: int,
    ) -> int:
        """Write what the network is told of each particle, and return the number of edges as :meth:`next_frame` does.

        It is at ``ahead`` (N, 3) in ballistic motion; ``distance`` (N,) and ``normal`` (N, 3) are the solid's there.

        Raises:
            ValueError: sizes do not fit, or the processor lacks the instruction set.
            MemoryError: the neighbors do not fit into memory.
        """
