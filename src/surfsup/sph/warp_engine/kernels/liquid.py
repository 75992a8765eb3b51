"""Sums over neighbors for surface tension and implicit viscosity in Warp, and the solids near particles.

The formulas are in :mod:`surfsup.sph.liquid`; the same as in ``native/sph/liquid_isa.hpp``.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from surfsup.sph import dfsph
from surfsup.sph.boundary.density import DISTANCE_OFFSET, MIN_DISTANCE, STRENGTH
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.warp_engine.kernels.boundary import PLANE, VOLUME_MAP, boundary_kernels
from surfsup.sph.warp_engine.kernels.substeps import substep_kernels
from surfsup.warp_runtime import Precision

ASIDE = 0.25  # squared, in squared kernel supports: where the reference has the volume of a solid beside its point


@cache
def liquid_kernels(precision: Precision) -> SimpleNamespace:
    """The kernels of a liquid in a precision."""
    real, vec3, mat33 = precision.real, precision.vec3, precision.mat33
    module = f"surfsup.liquid.{precision.name}"
    boundary, substeps = boundary_kernels(precision), substep_kernels(precision)
    Map, interpolate, wall_place, plane_fraction = (
        boundary.Map,
        boundary.interpolate,
        boundary.wall_place,
        boundary.plane_fraction,
    )
    kernel_value, gradient_factor = substeps.kernel_value, substeps.gradient_factor
    shrink, one, zero, half, two = real(1.0 / KERNEL_SUPPORT), real(1.0), real(0.0), real(0.5), real(2.0)
    self_density, softening = real(dfsph.SELF_DENSITY), real(dfsph.VISCOSITY_SOFTENING)
    normal_scale, tiny, offset = real(2.0 * dfsph.SELF_DENSITY / KERNEL_SUPPORT), real(1e-12), real(1.0 / 64.0)
    distance_offset, min_distance, strength = real(DISTANCE_OFFSET), real(MIN_DISTANCE), real(STRENGTH)
    aside, four, six, twenty_four = real(ASIDE), real(4.0), real(6.0), real(24.0)
    solid_density, vec4 = boundary.solid_density, wp.types.vector(4, real)
    plane, volume = wp.constant(PLANE), wp.constant(VOLUME_MAP)

    @wp.func
    def cohesion(distance: real) -> real:
        """The kernel of cohesion at a distance in kernel supports, without the factor 32 / (π h³)."""
        product = wp.max(one - distance, zero) * distance
        cube = product * product * product
        return wp.where(distance > half, cube, two * cube - offset)

    @wp.func
    def contact(distance: real, fraction: real, friction: real, adhesion: real) -> vec4:
        """Density of a solid, friction along its normal and across times the density in 1/s, and adhesion in m/s."""
        depth = wp.max(distance + distance_offset, min_distance) * shrink
        square = depth * depth + aside
        away = wp.sqrt(square)
        outer, inner = wp.max(one - away, zero), wp.max(half - away, zero)
        steepness = six * outer * outer - twenty_four * inner * inner
        scale = friction * strength * fraction * steepness * shrink * shrink / (away * (square + softening))
        bowl = wp.max(-four * depth * depth + six * depth - two, zero)
        pull = zero
        if depth > half:
            pull = adhesion * fraction * wp.sqrt(wp.sqrt(bowl))
        return vec4(solid_density(distance, fraction), scale * depth * depth, scale * half * aside, pull)

    @wp.kernel(module=module, enable_backward=False)
    def measure_density(
        positions: wp.array(dtype=vec3),
        neighbors: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
        density: wp.array(dtype=real),
    ):
        """The density of the liquid alone."""
        i = wp.tid()
        value = real(0.0)
        for k in range(counts[i]):
            value += kernel_value(shrink * wp.length(positions[neighbors[i, k]] - positions[i]))
        density[i] = self_density * (one + value)

    @wp.kernel(module=module, enable_backward=False)
    def find_normals(
        positions: wp.array(dtype=vec3),
        neighbors: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
        density: wp.array(dtype=real),
        normals: wp.array(dtype=vec3),
    ):
        """Surface normals, which point into the liquid and are zero within."""
        i = wp.tid()
        total = vec3()
        for k in range(counts[i]):
            j = neighbors[i, k]
            way = positions[j] - positions[i]
            total += (gradient_factor(shrink * wp.length(way)) / density[j]) * way
        normals[i] = normal_scale * total

    @wp.kernel(module=module, enable_backward=False)
    def sum_tension(
        positions: wp.array(dtype=vec3),
        neighbors: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
        density: wp.array(dtype=real),
        normals: wp.array(dtype=vec3),
        cohesion_factor: real,
        curvature: real,
        acceleration: wp.array(dtype=vec3),
    ):
        """Accelerations by cohesion and by the differences of surface normals."""
        i = wp.tid()
        total = vec3()
        for k in range(counts[i]):
            j = neighbors[i, k]
            r = shrink * (positions[j] - positions[i])
            distance = wp.sqrt(wp.max(wp.length_sq(r), tiny))
            if distance < one:
                weight = two / (density[i] + density[j])
                total += weight * (
                    (cohesion_factor * cohesion(distance) / distance) * r + curvature * (normals[j] - normals[i])
                )
        acceleration[i] = total

    @wp.kernel(module=module, enable_backward=False)
    def prepare_viscosity(
        positions: wp.array(dtype=vec3),
        neighbors: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
        density: wp.array(dtype=real),
        scale: real,
        factors: wp.array2d(dtype=real),
        diagonal: wp.array(dtype=mat33),
    ):
        """The factor of each pair in the matrix, and the block on its diagonal."""
        i = wp.tid()
        block = mat33()
        for k in range(counts[i]):
            j = neighbors[i, k]
            r = shrink * (positions[j] - positions[i])
            squared = wp.length_sq(r)
            factor = scale * gradient_factor(wp.sqrt(squared)) / ((squared + softening) * density[i] * density[j])
            factors[i, k] = factor
            block += factor * wp.outer(r, r)
        diagonal[i] = block

    @wp.kernel(module=module, enable_backward=False)
    def multiply(
        positions: wp.array(dtype=vec3),
        neighbors: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
        factors: wp.array2d(dtype=real),
        vectors: wp.array(dtype=vec3),
        product: wp.array(dtype=vec3),
    ):
        """The pairs' part of the matrix times vectors."""
        i = wp.tid()
        total = vec3()
        for k in range(counts[i]):
            j = neighbors[i, k]
            r = shrink * (positions[j] - positions[i])
            total += (factors[i, k] * wp.dot(r, vectors[i] - vectors[j])) * r
        product[i] = total

    @wp.kernel(module=module, enable_backward=False)
    def place_walls(
        positions: wp.array(dtype=vec3),
        rotation: mat33,
        translation: vec3,
        lower: vec3,
        upper: vec3,
        wall_cell: vec3,
        table: wp.array(dtype=real),
        friction: real,
        adhesion: real,
        values: wp.array(dtype=vec4),
        normal: wp.array(dtype=vec3),
    ):
        """What the walls do to the particles, and their normal; they may stand in a frame of their own."""
        i = wp.tid()
        found = wall_place(wp.transpose(rotation) * (positions[i] - translation), lower, upper, wall_cell, table)
        values[i] = contact(found[0], found[1], friction, adhesion)
        normal[i] = -(rotation * vec3(found[2], found[3], found[4]))

    @wp.kernel(module=module, enable_backward=False)
    def place_solid(
        positions: wp.array(dtype=vec3),
        rotation: mat33,
        translation: vec3,
        predicted: wp.array(dtype=vec3),
        solid_distance: wp.array(dtype=real),
        solid_normal: wp.array(dtype=vec3),
        solid: int,
        table: wp.array(dtype=real),
        volume_map: Map,
        node_places: wp.array(dtype=vec3),
        cell_indices: wp.array(dtype=int),
        nodes: wp.array2d(dtype=real),
        friction: real,
        adhesion: real,
        values: wp.array(dtype=vec4),
        normal: wp.array(dtype=vec3),
    ):
        """What a solid does to the particles, and its normal: a plane, or a map that may be in a frame of its own."""
        i = wp.tid()
        if solid == plane:
            distance = solid_distance[i] + wp.dot(positions[i] - predicted[i], solid_normal[i])
            values[i] = contact(distance, plane_fraction(distance, table), friction, adhesion)
            normal[i] = solid_normal[i]
        if solid == volume:
            own = wp.transpose(rotation) * (positions[i] - translation)
            found = interpolate(volume_map, node_places, cell_indices, nodes, own)
            values[i] = contact(found[0], found[1], friction, adhesion)
            normal[i] = rotation * vec3(found[2], found[3], found[4])

    return SimpleNamespace(
        kernels=[
            measure_density,
            find_normals,
            sum_tension,
            prepare_viscosity,
            multiply,
            place_walls,
            place_solid,
        ],
        measure_density=measure_density,
        find_normals=find_normals,
        sum_tension=sum_tension,
        prepare_viscosity=prepare_viscosity,
        vec4=vec4,
        multiply=multiply,
        place_walls=place_walls,
        place_solid=place_solid,
    )
