"""Types of the C++ module. Matrices are stored as torch stores them, one row per output."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

Matrix: TypeAlias = np.ndarray
Bias: TypeAlias = np.ndarray
Vectors: TypeAlias = np.ndarray
Values: TypeAlias = np.ndarray
Vector: TypeAlias = np.ndarray
# Table (X Y Z, 4), first node, center, cell, nodes (X, Y, Z): see surfsup.sdf.grid.SdfGrid.
Grid: TypeAlias = tuple[np.ndarray, tuple[float, ...], tuple[float, ...], float, tuple[int, ...]]
# A native solid, or a function that writes distance (N,) and, unless None, unit normal (N, 3) of points (N, 3).
SolidQuery: TypeAlias = "Solid | Callable[[Vectors, Values, Vectors | None], None]"
# Arrays of a substep: positions (N, 3), kernel sums (N, 8), density gradient (N, 3), boundary density (N,), its
# gradient (N, 3), density error (N,), density rate (N,).
Record: TypeAlias = tuple[np.ndarray, ...]
# What moves: maps of the solids, boxes around them (K, 2, 3) float32, their queries, poses before and after (K, 2, 7)
# float64, where each particle last queried them (K, N, 3) float32 and the distance there (K, N) float32, both updated;
# poses of the walls (2, 7) float64 or None. A pose is a position and a quaternion w, x, y, z.
Moving: TypeAlias = tuple[object, ...]
# Impulses for unit mass and their moments about the origin of the world (R, 6) float64, added to: of the walls, the
# solids that stand still, those that move; and which still solid each particle is at (N,) int32, None with one or none.
Impulses: TypeAlias = tuple[np.ndarray, np.ndarray | None, Values | None]

# float32, or the bits of bfloat16 as uint16.
Numbers: TypeAlias = np.ndarray
# Of a perceptron, float32: weights and biases of the first, hidden and output layer, scale and shift of the LayerNorm.
PerceptronWeights: TypeAlias = tuple[np.ndarray | None, ...]
# What a backward pass needs: hidden layers and normalized output (rows, width), inverse standard deviation (rows,).
Activations: TypeAlias = tuple[np.ndarray, ...]

def instruction_sets() -> list[str]:
    """Instruction sets that this processor supports, the fastest first."""

def find_neighbor_pairs(
    positions: Vectors, radius: float, max_pairs: int, threads: int
) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
    """All ordered pairs within ``radius``: their number, starts (N + 1,), receivers (E,), senders (E,), all int64.

    Beyond ``max_pairs`` the search stops. The number is -1 where a position is not finite. Both leave the arrays empty.

    Raises:
        MemoryError: the pairs do not fit into memory.
    """

def energy_gain(
    positions: Vectors,
    velocities: Vectors,
    new_positions: Vectors,
    new_velocities: Vectors,
    gravity: Vector,
    masses: Values | None = None,
) -> float:
    """Mechanical energy that a step adds, mean J/kg. Arrays are (N, 3), ``gravity`` is (3,), ``masses`` are (N,)."""

def limit_energy_gain(
    positions: Vectors,
    velocities: Vectors,
    ballistic_positions: Vectors,
    ballistic_velocities: Vectors,
    new_positions: Vectors,
    new_velocities: Vectors,
    gravity: Vector,
    max_gain: float,
    max_delta_velocity: float,
    halvings: int,
    masses: Values | None = None,
) -> None:
    """Shorten the changes against free fall in place until a step adds at most ``max_gain`` J/kg. Arrays are (N, 3)."""

def resolve_collisions(
    before: Vectors,
    positions: Vectors,
    velocities: Vectors,
    collided: np.ndarray,
    lower: Vector,
    upper: Vector,
    parameters: CollisionParameters,
    solid: SolidQuery | None,
    query_positions: Vectors | None,
    query_distance: Values | None,
    impulses: Impulses | None,
    isa: str,
    threads: int,
) -> None:
    """:func:`surfsup.sph.collision.resolve_collisions` in place; marks the particles that ``collided`` (N,).

    Args:
        before: (N, 3) positions one frame earlier.
        positions, velocities: (N, 3), changed.
        collided: (N,) bool, written.
        lower, upper: (3,) corners of the container.
        parameters: clearance and rounds.
        solid: None if there is none.
        query_positions, query_distance: (N, 3) and (N,), where each particle last queried the solid; None if unknown.
        impulses: on walls and solid; None if they are not requested.
        isa: instruction set.
        threads: at most.

    Raises:
        ValueError: sizes do not fit, or the processor lacks the instruction set.
    """

def resolve_moving_collisions(
    before: Vectors,
    positions: Vectors,
    velocities: Vectors,
    collided: np.ndarray,
    lower: Vector,
    upper: Vector,
    parameters: CollisionParameters,
    solid: SolidQuery | None,
    moving: Moving,
    frame_time: float,
    impulses: Impulses | None,
    isa: str,
    threads: int,
) -> None:
    """:func:`resolve_collisions` beside solids and walls that move for ``frame_time`` seconds.

    Raises:
        ValueError: sizes do not fit, or the processor lacks the instruction set.
    """

class BoundaryMap:
    """Arrays of a boundary volume map, copied."""

    def __init__(
        self, lower: np.ndarray, cell: np.ndarray, resolution: np.ndarray, cell_indices: np.ndarray, nodes: np.ndarray
    ) -> None:
        """See :class:`surfsup.sph.boundary.boundary_map.MapTables`.

        Raises:
            ValueError: sizes do not fit.
        """

class BoundaryParameters:
    """Parameters of boundary densities; see sph/parameters.hpp."""

    distance_offset: float
    min_distance: float
    strength: float
    wall_cell: float
    min_wall_distance: float
    fraction_start: float
    fraction_step: float
    plane_fraction: list[float]

class CollisionParameters:
    """Parameters of collision handling; see sph/parameters.hpp."""

    clearance: float
    tolerance: float
    lipschitz_bound: float
    rounds: int

class SolverParameters:
    """Parameters of the solver; see sph/parameters.hpp."""

    kernel_support: float
    frame_time: float
    substeps: int
    self_density: float
    divergence_relaxation: float
    density_relaxation: float
    divergence_deadband: float
    min_squared_gradient: float
    max_density_error: float
    viscosity: float
    viscosity_softening: float
    max_energy_gain: float
    boundary: BoundaryParameters
    collision: CollisionParameters

class LiquidParameters:
    """Parameters of a liquid; see sph/liquid.hpp."""

    mass: float
    implicit_viscosity: bool
    viscosity: float
    friction: float
    cohesion: float
    curvature: float
    adhesion: float
    tolerance: float
    max_iterations: int

class StepResult:
    """How a step ended.

    Attributes:
        pairs: number of neighbor pairs; above ``max_pairs`` or -1 the step stopped early.
        outer_work: of what moves, of surface tension and adhesion on the particles, mean J/kg.
        finished: False where the energy limit was exceeded and the caller must finish the step.
    """

    @property
    def pairs(self) -> int: ...
    @property
    def outer_work(self) -> float: ...
    @property
    def finished(self) -> bool: ...

class Solver:
    """The DFSPH solver, with buffers that it keeps from step to step."""

    def __init__(self, parameters: SolverParameters) -> None:
        """Copy the parameters.

        Raises:
            ValueError: they make no solver.
        """

    def step(
        self,
        *,
        positions: Vectors,
        velocities: Vectors,
        gravity: Vector,
        lower: Vector,
        upper: Vector,
        boundary_map: BoundaryMap | None,
        rotation: np.ndarray,
        solid: SolidQuery | None,
        handle_collisions: bool,
        query_positions: Vectors,
        query_distance: Values,
        new_positions: Vectors,
        new_velocities: Vectors,
        collided: np.ndarray,
        record: Record | None,
        moving: Moving | None,
        impulses: Impulses | None,
        liquids: tuple[list[LiquidParameters], np.ndarray | None] | None,
        isa: str,
        threads: int,
        max_pairs: int,
    ) -> StepResult:
        """Compute a frame: free fall, query of the solid, substeps, energy limit, collision handling.

        Args:
            positions, velocities: (N, 3) at the frame's start.
            gravity: (3,), m/s².
            lower, upper: (3,) corners of the container.
            boundary_map: of the solid; without it the solid is a plane through its nearest point.
            rotation: (3, 3), of the map.
            solid: None if there is none.
            handle_collisions: whether to move particles out of solid and walls.
            query_positions, query_distance: (N, 3) and (N,), where each particle last queried the solid; updated.
            new_positions, new_velocities: (N, 3), written.
            collided: (N,) bool, written.
            record: arrays for the last substep, written.
            moving: what moves in the frame, without a record; None if nothing does.
            impulses: on walls and solids; None if they are not requested.
            liquids: what flows, with the number (N,) int32 of each particle's liquid if there are several; None for
                the solver's own water.
            isa: instruction set.
            threads: at most.
            max_pairs: of neighbors; the step stops beyond it.

        Raises:
            MemoryError: the neighbors do not fit into memory.
            ValueError: sizes do not fit, or the processor lacks the instruction set.
        """

def convolve(
    starts: np.ndarray,
    senders: np.ndarray,
    kernels: np.ndarray,
    hidden: Matrix,
    mix: Matrix,
    self: Matrix,
    out: Matrix,
    threads: int,
) -> None:
    """Write self h_i + sum_j sum_m k_m(i, j) mix_m h_j to ``out`` (N, C); C is a multiple of 16.

    Raises:
        ValueError: sizes do not fit.
    """

def convolve_gradient(
    starts: np.ndarray,
    senders: np.ndarray,
    kernels: np.ndarray,
    hidden: Matrix,
    mix: Matrix,
    self: Matrix,
    out_gradient: Matrix,
    hidden_gradient: Matrix | None,
    mix_gradient: Matrix,
    self_gradient: Matrix,
    threads: int,
) -> None:
    """Write the gradients in the arguments of :func:`convolve` from the gradient in its result.

    Raises:
        ValueError: sizes do not fit.
    """

def has_bfloat16(isa: str) -> bool:
    """Whether this processor multiplies matrices of bfloat16 with the instruction set.

    Raises:
        ValueError: the processor lacks the instruction set.
    """

def rows_forward(
    rows: Matrix,
    weights: PerceptronWeights,
    epsilon: float,
    kept: Activations | None,
    out: Numbers,
    first_bfloat16: bool,
    bfloat16: bool,
    isa: str,
    threads: int,
) -> None:
    """Write a perceptron of ``rows`` (M, k) to ``out`` (M, C), and what a backward pass needs to ``kept``.

    Args:
        rows: float32.
        weights: C is a multiple of 16.
        epsilon: of the LayerNorm.
        kept: in the precision of the layers after the first; None if there will be no backward pass.
        out: float32, or in that precision.
        first_bfloat16, bfloat16: whether the first layer and the others compute in bfloat16.
        isa: instruction set.
        threads: at most.

    Raises:
        ValueError: sizes or precisions do not fit, or the processor lacks the instruction set.
    """

def rows_backward(
    rows: Matrix,
    weights: PerceptronWeights,
    epsilon: float,
    kept: Activations,
    out_gradient: Numbers,
    rows_gradient: Matrix | None,
    weights_gradient: PerceptronWeights,
    first_bfloat16: bool,
    isa: str,
    threads: int,
) -> None:
    """Write the gradients in the arguments of :func:`rows_forward` from the gradient in its result.

    Raises:
        ValueError: sizes or precisions do not fit, or the processor lacks the instruction set.
    """

def edges_forward(
    starts: np.ndarray,
    senders: np.ndarray,
    endpoints: Numbers,
    edges: Numbers,
    weights: PerceptronWeights,
    epsilon: float,
    kept: Activations | None,
    received: Matrix,
    new_edges: Numbers | None,
    isa: str,
    threads: int,
) -> None:
    """Write the sums of messages at their receivers to ``received`` (N, C), and edges plus messages to ``new_edges``.

    A message is a perceptron of the edge, whose first layer adds what both ends contribute.

    Args:
        starts, senders: see :class:`surfsup.sph.neighbor_search.NeighborList`.
        endpoints: (N, 2 C), contribution of each node as sender and as receiver, in the precision of the edges.
        edges: (E, C); the network computes in their precision.
        weights: the first layer has no bias; C is a multiple of 16.
        epsilon: of the LayerNorm.
        kept: None if there will be no backward pass.
        received: float32.
        new_edges: (E, C) or None.
        isa: instruction set.
        threads: at most.

    Raises:
        ValueError: sizes or precisions do not fit, or the processor lacks the instruction set.
    """

def edges_backward(
    starts: np.ndarray,
    senders: np.ndarray,
    edges: Numbers,
    weights: PerceptronWeights,
    epsilon: float,
    kept: Activations,
    received_gradient: Matrix,
    new_edges_gradient: Numbers | None,
    edges_gradient: Numbers,
    first_gradient: Numbers,
    endpoints_gradient: Numbers,
    weights_gradient: PerceptronWeights,
    isa: str,
    threads: int,
) -> None:
    """Write the gradients in the arguments of :func:`edges_forward` from those in its results.

    ``first_gradient`` (E, C) receives that of the first layer before its ReLU.

    Raises:
        ValueError: sizes or precisions do not fit, an edge has no reverse, or the processor lacks the instruction set.
    """

def sum_kernels(
    starts: np.ndarray, senders: np.ndarray, kernels: np.ndarray, values: np.ndarray, sums: np.ndarray, threads: int
) -> None:
    """Write sum_j k_m(i, j) v_j of values (N, 4) to ``sums`` (N, 4, 4)."""

def sum_kernels_gradient(
    starts: np.ndarray,
    senders: np.ndarray,
    kernels: np.ndarray,
    sums_gradient: np.ndarray,
    values_gradient: np.ndarray,
    threads: int,
) -> None:
    """Write the gradient in the values of :func:`sum_kernels` from that in its sums."""

def interpolate_grid(grid: Grid, points: np.ndarray, distance: np.ndarray, gradient: np.ndarray, threads: int) -> None:
    """Write :meth:`surfsup.sdf.grid.SdfGrid.interpolate` at ``points`` (N, 3) inside the grid, all float64.

    Raises:
        ValueError: sizes do not fit.
    """

class TriangleBvh:
    """A bounding volume hierarchy of triangles, which are copied."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        """Build it from vertices (V, 3) float64 and faces (F, 3) int64.

        Raises:
            IndexError: a face has an invalid vertex index, or there are no faces.
        """

    def nearest(
        self,
        points: np.ndarray,
        max_distance: np.ndarray | None,
        distance: np.ndarray,
        face: np.ndarray,
        closest: np.ndarray,
        threads: int,
    ) -> None:
        """Write distance (N,), face (N,) int64 and closest point (N, 3) of ``points`` (N, 3); all others are float64.

        ``max_distance`` (N,) is an upper bound of the distance; a smaller bound makes the search faster.

        Raises:
            ValueError: sizes do not fit.
        """

class Solid:
    """A solid of closed-form shapes, networks and meshes, combined by set operations."""

    def __init__(self, kind: str, parameters: list[float], parts: list[Solid]) -> None:
        """Copy parameters and parts.

        Raises:
            ValueError: the kind is unknown, or has another number of parameters or parts.
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
        grid: Grid | None,
        network_range: float,
    ) -> Solid:
        """The zero set of a network in its own frame. Arrays are float32; all but the table of the grid are copied.

        Args:
            layers, last, last_bias, code, frequency, octaves: see
                :class:`surfsup.sdf.neural.native_layers.NativeLayers`.
            grid: distances far from the surface.
            network_range: distance on the grid below which the network is evaluated.

        Raises:
            ValueError: sizes do not fit.
        """

    @staticmethod
    def of_mesh(
        *,
        bvh: TriangleBvh,
        fine: Grid,
        coarse: Grid,
        node_distance: np.ndarray,
        mesh_range: float,
        min_agreement: float,
        on_surface: float,
        query_undecided: Callable[[Vectors, Values, Vectors], None],
    ) -> Solid:
        """The solid enclosed by triangles; no array is copied.

        Args:
            bvh: the triangles, queried near the surface.
            fine: grid around the triangles.
            coarse: grid around ``fine``.
            node_distance: (N,) float64, signed distance of the nodes of ``fine``.
            mesh_range: distance on the grid below which the triangles are queried, meters.
            min_agreement: length of the gradient on the grid below which the triangles are queried.
            on_surface: distance below which rounding dominates the direction of the normal, meters.
            query_undecided: writes distance and normal of points whose side of the surface is not known.

        Raises:
            ValueError: sizes do not fit.
        """

    def evaluate(self, points: Vectors, distance: Values, normal: Vectors | None, isa: str, threads: int) -> None:
        """Write signed distance (N,) and, unless None, unit normal (N, 3) of ``points`` (N, 3), all float32.

        Raises:
            ValueError: sizes do not fit, or the processor lacks the instruction set.
        """
