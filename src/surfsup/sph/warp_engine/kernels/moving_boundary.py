"""Density of solids and walls that move, in Warp: their maps at their places, and the rate by which they approach.

The same as in ``native/sph/boundary_isa.hpp``. Warp derives the adjoints itself, also those in the places.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from surfsup.sph.dfsph import GRADIENT_SCALE
from surfsup.sph.warp_engine.kernels.boundary import boundary_kernels
from surfsup.warp_runtime import Precision


@cache
def moving_boundary_kernels(precision: Precision) -> SimpleNamespace:
    """The kernels that add what moves to the boundary density, in a precision."""
    real, vec3, mat33 = precision.real, precision.vec3, precision.mat33
    module = f"surfsup.moving_boundary.{precision.name}"
    boundary = boundary_kernels(precision)
    Map, interpolate, walls = boundary.Map, boundary.interpolate, boundary.walls
    solid_density, solid_slope = boundary.solid_density, boundary.solid_slope
    scale = real(GRADIENT_SCALE)

    @wp.kernel(module=module)
    def add_moving_solid(
        positions: wp.array(dtype=vec3),
        matrices: wp.array(dtype=mat33),
        vectors: wp.array(dtype=vec3),
        place: int,
        lower: vec3,
        upper: vec3,
        volume_map: Map,
        node_places: wp.array(dtype=vec3),
        cell_indices: wp.array(dtype=int),
        nodes: wp.array2d(dtype=real),
        density: wp.array(dtype=real),
        gradient: wp.array(dtype=vec3),
        approach: wp.array(dtype=real),
    ):
        """Add a solid within a box in its own frame; ``place`` counts its matrices and vectors."""
        i = wp.tid()
        rotation, turn = matrices[2 * place], matrices[2 * place + 1]
        translation, drift = vectors[2 * place], vectors[2 * place + 1]
        arm = positions[i] - translation
        own = wp.transpose(rotation) * arm
        outside = own[0] < lower[0] or own[1] < lower[1] or own[2] < lower[2]
        outside = outside or own[0] > upper[0] or own[1] > upper[1] or own[2] > upper[2]
        if not outside:
            found = interpolate(volume_map, node_places, cell_indices, nodes, own)
            towards = -solid_slope(found[0], found[1]) * (rotation * vec3(found[2], found[3], found[4]))
            density[i] += solid_density(found[0], found[1])
            gradient[i] += towards
            approach[i] += wp.dot(towards, turn * arm + drift) / scale

    @wp.kernel(module=module)
    def add_moving_walls(
        positions: wp.array(dtype=vec3),
        matrices: wp.array(dtype=mat33),
        vectors: wp.array(dtype=vec3),
        place: int,
        lower: vec3,
        upper: vec3,
        wall_cell: vec3,
        table: wp.array(dtype=real),
        density: wp.array(dtype=real),
        gradient: wp.array(dtype=vec3),
        approach: wp.array(dtype=real),
    ):
        """Add the walls of a container that moves."""
        i = wp.tid()
        rotation, turn = matrices[2 * place], matrices[2 * place + 1]
        translation, drift = vectors[2 * place], vectors[2 * place + 1]
        arm = positions[i] - translation
        found = walls(wp.transpose(rotation) * arm, lower, upper, wall_cell, table)
        towards = rotation * vec3(found[1], found[2], found[3])
        density[i] += found[0]
        gradient[i] += towards
        approach[i] += wp.dot(towards, turn * arm + drift) / scale

    @wp.kernel(module=module, enable_backward=False)
    def add_work(pressure: wp.array(dtype=real), approach: wp.array(dtype=real), work: wp.array(dtype=real)):
        """Add what moving solids do to the particles in a substep, J/kg: impulse times velocity."""
        i = wp.tid()
        work[i] -= scale * pressure[i] * approach[i]

    return SimpleNamespace(
        kernels=[add_moving_solid, add_moving_walls, add_work],
        add_moving_solid=add_moving_solid,
        add_moving_walls=add_moving_walls,
        add_work=add_work,
    )
