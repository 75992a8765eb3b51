"""Boundary density in Warp: the container's walls, and a solid as a volume map or as a plane.

The formulas are those of :mod:`surfsup.sph.boundary`. Warp derives the adjoint of :func:`boundary_kernels` itself.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from surfsup.sph.boundary.density import (
    DISTANCE_OFFSET,
    FRACTION_STEP,
    MIN_DEPTH,
    MIN_DISTANCE,
    STRENGTH,
    plane_fraction_table,
)
from surfsup.sph.boundary.shape_functions import CELL_NODES
from surfsup.sph.boundary.walls import MIN_WALL_DISTANCE
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.warp_runtime import Precision

NO_SOLID, PLANE, VOLUME_MAP = 0, 1, 2  # how the solid is given
NODES = len(CELL_NODES)
ENTRIES = len(plane_fraction_table())


@cache
def boundary_kernels(precision: Precision) -> SimpleNamespace:
    """The kernel that evaluates the boundary density, and the struct of a volume map, in a precision."""
    real, vec3, mat33 = precision.real, precision.vec3, precision.mat33
    vec4, vec5 = wp.types.vector(4, real), wp.types.vector(5, real)
    module = f"surfsup.boundary.{precision.name}"
    support, one, zero = real(KERNEL_SUPPORT), real(1.0), real(0.0)
    offset, min_distance, strength = real(DISTANCE_OFFSET), real(MIN_DISTANCE), real(STRENGTH)
    min_depth, fraction_step, last_place = real(MIN_DEPTH), real(FRACTION_STEP), real(ENTRIES - 1)
    min_wall_distance, tiny = real(MIN_WALL_DISTANCE), real(1e-12)
    two, six, eight, nine, half = real(2.0), real(6.0), real(8.0), real(9.0), real(0.5)
    eighteen, nineteen, twenty_four = real(18.0), real(19.0), real(24.0)
    corner_part, edge_part = real(1.0 / 64.0), real(9.0 / 64.0)
    entries, node_count = wp.constant(ENTRIES), wp.constant(NODES)
    far, fifty_four = real(10 * KERNEL_SUPPORT), real(54.0)

    @wp.struct
    class Map:
        lower: vec3
        cell: vec3
        rotation: mat33
        resolution: wp.vec3i

    @wp.func
    def plane_fraction(distance: real, table: wp.array(dtype=real)) -> real:
        """Volume fraction of a plane solid at a signed distance."""
        place = wp.clamp((distance - min_depth) / fraction_step, zero, last_place)
        low = wp.clamp(int(place), 0, entries - 2)
        part = place - real(low)
        return table[low] * (one - part) + table[low + 1] * part

    @wp.func
    def kernel_place(distance: real) -> real:
        return wp.min(wp.max(distance + offset, min_distance), support) / support

    @wp.func
    def solid_density(distance: real, fraction: real) -> real:
        q = kernel_place(distance)
        outer, inner = one - q, wp.max(half - q, zero)
        return strength * fraction * (two * outer * outer * outer - eight * inner * inner * inner)

    @wp.func
    def solid_slope(distance: real, fraction: real) -> real:
        """Increase of the density towards the solid, 1/m."""
        q = kernel_place(distance)
        outer, inner = one - q, wp.max(half - q, zero)
        return strength * fraction * (six * outer * outer - twenty_four * inner * inner) / support

    @wp.func
    def wall_steepness(part: real, cell: real, below: real, above: real) -> real:
        steep = zero
        if part < one:
            steep = one / (part * cell)
        if below < above:
            steep = -steep
        return steep

    @wp.func
    def node_factor(node: real, along: real) -> real:
        """The factor along one axis of a node's shape function; edge nodes have two corners beside them."""
        factor = one + node * along
        if wp.abs(node) < half:
            factor = (one - along * along) * (one + nine * node * along)
        return factor

    @wp.func
    def node_slope(node: real, along: real) -> real:
        """The derivative of :func:`node_factor`."""
        slope = node
        if wp.abs(node) < half:
            slope = nine * node * (one - along * along) - two * along * (one + nine * node * along)
        return slope

    @wp.func
    def node_bend(node: real, along: real) -> real:
        """The derivative of :func:`node_slope`."""
        bend = real(0.0)
        if wp.abs(node) < half:
            bend = -two - fifty_four * node * along
        return bend

    @wp.func
    def corner_share(node: vec3) -> real:
        """1 for a corner of the cell, 0 for a node on an edge."""
        share = real(0.0)
        if wp.abs(node[0]) > half and wp.abs(node[1]) > half and wp.abs(node[2]) > half:
            share = real(1.0)
        return share

    @wp.func
    def node_value(node: vec3, local: vec3) -> real:
        """The shape function of a node at local coordinates."""
        share = corner_share(node)
        weight = share * corner_part * (nine * wp.length_sq(local) - nineteen) + (one - share) * edge_part
        return weight * node_factor(node[0], local[0]) * node_factor(node[1], local[1]) * node_factor(node[2], local[2])

    @wp.func
    def node_gradient(node: vec3, local: vec3) -> vec3:
        """The gradient of :func:`node_value`."""
        x, y, z = node_factor(node[0], local[0]), node_factor(node[1], local[1]), node_factor(node[2], local[2])
        share = corner_share(node)
        weight = share * corner_part * (nine * wp.length_sq(local) - nineteen) + (one - share) * edge_part
        product = vec3(
            node_slope(node[0], local[0]) * y * z,
            x * node_slope(node[1], local[1]) * z,
            x * y * node_slope(node[2], local[2]),
        )
        return weight * product + share * corner_part * eighteen * x * y * z * local

    @wp.func
    def node_hessian_times(node: vec3, local: vec3, along: vec3) -> vec3:
        """The derivative of :func:`node_gradient` along a vector."""
        x, y, z = node_factor(node[0], local[0]), node_factor(node[1], local[1]), node_factor(node[2], local[2])
        dx, dy, dz = node_slope(node[0], local[0]), node_slope(node[1], local[1]), node_slope(node[2], local[2])
        share = corner_share(node)
        weight = share * corner_part * (nine * wp.length_sq(local) - nineteen) + (one - share) * edge_part
        product = vec3(dx * y * z, x * dy * z, x * y * dz)
        bent = vec3(
            node_bend(node[0], local[0]) * y * z * along[0] + dx * (dy * z * along[1] + y * dz * along[2]),
            node_bend(node[1], local[1]) * x * z * along[1] + dy * (dx * z * along[0] + x * dz * along[2]),
            node_bend(node[2], local[2]) * x * y * along[2] + dz * (dx * y * along[0] + x * dy * along[1]),
        )
        radial = share * corner_part * eighteen
        return weight * bent + radial * (
            wp.dot(local, along) * product + wp.dot(product, along) * local + x * y * z * along
        )

    @wp.func
    def map_place(volume_map: Map, position: vec3) -> vec3:
        """A position in cells of the map, from its lowest corner."""
        return wp.cw_div(wp.transpose(volume_map.rotation) * position - volume_map.lower, volume_map.cell)

    @wp.func
    def stored_cell(volume_map: Map, cell_indices: wp.array(dtype=int), place: vec3) -> int:
        """The index of the cell with nodes at a place; -1 where there is none."""
        stored = int(-1)
        if wp.isfinite(place):
            x, y, z = int(wp.floor(place[0])), int(wp.floor(place[1])), int(wp.floor(place[2]))
            sizes = volume_map.resolution
            if x >= 0 and y >= 0 and z >= 0 and x < sizes[0] and y < sizes[1] and z < sizes[2]:
                stored = cell_indices[x + sizes[0] * (y + sizes[1] * z)]
        return stored

    @wp.func
    def local_place(place: vec3) -> vec3:
        """The coordinates in a cell, from -1 to 1."""
        return vec3(
            two * (place[0] - wp.floor(place[0])) - one,
            two * (place[1] - wp.floor(place[1])) - one,
            two * (place[2] - wp.floor(place[2])) - one,
        )

    @wp.func
    def interpolate(
        volume_map: Map,
        places: wp.array(dtype=vec3),
        cell_indices: wp.array(dtype=int),
        nodes: wp.array2d(dtype=real),
        position: vec3,
    ) -> vec5:
        """Distance in meters, volume fraction and unit normal (3) of the solid; beyond the map a large distance."""
        place = map_place(volume_map, position)
        stored = stored_cell(volume_map, cell_indices, place)
        found = vec5(far, zero, zero, zero, zero)
        if stored >= 0:
            local = local_place(place)
            distance, fraction, slope = real(0.0), real(0.0), vec3()
            for k in range(node_count):
                value = node_value(places[k], local)
                distance += value * nodes[stored, k]
                fraction += value * nodes[stored, node_count + k]
                slope += nodes[stored, k] * node_gradient(places[k], local)
            normal = volume_map.rotation * wp.cw_div(slope, volume_map.cell)
            normal = normal / (wp.length(normal) + tiny)
            found = vec5(distance, fraction, normal[0], normal[1], normal[2])
        return found

    @wp.func_grad(interpolate)
    def interpolate_adjoint(
        volume_map: Map,
        places: wp.array(dtype=vec3),
        cell_indices: wp.array(dtype=int),
        nodes: wp.array2d(dtype=real),
        position: vec3,
        adjoint: vec5,
    ):
        place = map_place(volume_map, position)
        stored = stored_cell(volume_map, cell_indices, place)
        if stored >= 0:
            local = local_place(place)
            distance_slope, fraction_slope = vec3(), vec3()
            for k in range(node_count):
                gradient = node_gradient(places[k], local)
                distance_slope += nodes[stored, k] * gradient
                fraction_slope += nodes[stored, node_count + k] * gradient
            normal = volume_map.rotation * wp.cw_div(distance_slope, volume_map.cell)
            length = wp.length(normal) + tiny
            normal = normal / length
            of_normal = vec3(adjoint[2], adjoint[3], adjoint[4])
            of_normal = (of_normal - wp.dot(normal, of_normal) * normal) / length
            along = wp.cw_div(wp.transpose(volume_map.rotation) * of_normal, volume_map.cell)
            of_local = adjoint[0] * distance_slope + adjoint[1] * fraction_slope
            for k in range(node_count):
                of_local += nodes[stored, k] * node_hessian_times(places[k], local, along)
            wp.adjoint[position] += volume_map.rotation * (two * wp.cw_div(of_local, volume_map.cell))

    @wp.func
    def beside_walls(position: vec3, lower: vec3, upper: vec3, wall_cell: vec3) -> bool:
        """Whether a wall is within a cell."""
        nearest = wp.min(position - lower, upper - position)
        return nearest[0] < wall_cell[0] or nearest[1] < wall_cell[1] or nearest[2] < wall_cell[2]

    @wp.func
    def wall_place(position: vec3, lower: vec3, upper: vec3, wall_cell: vec3, table: wp.array(dtype=real)) -> vec5:
        """Distance and volume fraction of the container's walls, and the direction (3) towards them."""
        place = vec5(far, zero, zero, zero, zero)
        below, above = position - lower, upper - position
        nearest = wp.min(below, above)
        if beside_walls(position, lower, upper, wall_cell):
            x = wp.min(wp.max(nearest[0], min_wall_distance) / wall_cell[0], one)
            y = wp.min(wp.max(nearest[1], min_wall_distance) / wall_cell[1], one)
            z = wp.min(wp.max(nearest[2], min_wall_distance) / wall_cell[2], one)
            open_part = (one - x) + (one - y) + (one - z)
            side = ((one - x) * wall_cell[0] + (one - y) * wall_cell[1] + (one - z) * wall_cell[2]) / open_part
            rounded_distance = x * y * z * side
            towards = vec3(
                wall_steepness(x, wall_cell[0], below[0], above[0]),
                wall_steepness(y, wall_cell[1], below[1], above[1]),
                wall_steepness(z, wall_cell[2], below[2], above[2]),
            )
            free = (
                (one - plane_fraction(nearest[0], table))
                * (one - plane_fraction(nearest[1], table))
                * (one - plane_fraction(nearest[2], table))
            )
            direction = wp.normalize(towards)
            place = vec5(rounded_distance, one - free, direction[0], direction[1], direction[2])
        return place

    @wp.func
    def walls(position: vec3, lower: vec3, upper: vec3, wall_cell: vec3, table: wp.array(dtype=real)) -> vec4:
        """Density of the container's walls, and its gradient (3), 1/m."""
        place = wall_place(position, lower, upper, wall_cell, table)
        slope = solid_slope(place[0], place[1])
        return vec4(solid_density(place[0], place[1]), slope * place[2], slope * place[3], slope * place[4])

    @wp.kernel(module=module)
    def evaluate_boundary(
        positions: wp.array(dtype=vec3),
        predicted: wp.array(dtype=vec3),
        solid_distance: wp.array(dtype=real),
        solid_normal: wp.array(dtype=vec3),
        lower: vec3,
        upper: vec3,
        wall_cell: vec3,
        table: wp.array(dtype=real),
        solid: int,
        volume_map: Map,
        node_places: wp.array(dtype=vec3),
        cell_indices: wp.array(dtype=int),
        nodes: wp.array2d(dtype=real),
        density: wp.array(dtype=real),
        gradient: wp.array(dtype=vec3),
    ):
        i = wp.tid()
        position = positions[i]
        total, slopes = real(0.0), vec3()

        if beside_walls(position, lower, upper, wall_cell):
            wall = walls(position, lower, upper, wall_cell, table)
            total += wall[0]
            slopes += vec3(wall[1], wall[2], wall[3])

        if solid == 1:
            # Without a map the solid is a plane through its nearest point, as seen from the predicted position.
            normal = solid_normal[i]
            distance = solid_distance[i] + wp.dot(position - predicted[i], normal)
            if wp.isnan(distance):
                total += distance
            if distance < support:
                fraction = plane_fraction(distance, table)
                total += solid_density(distance, fraction)
                slopes -= solid_slope(distance, fraction) * normal

        if solid == 2:
            found = interpolate(volume_map, node_places, cell_indices, nodes, position)
            total += solid_density(found[0], found[1])
            slopes -= solid_slope(found[0], found[1]) * vec3(found[2], found[3], found[4])

        density[i] = total
        gradient[i] = slopes

    return SimpleNamespace(
        kernels=[evaluate_boundary],
        evaluate_boundary=evaluate_boundary,
        Map=Map,
        walls=walls,
        wall_place=wall_place,
        plane_fraction=plane_fraction,
        interpolate=interpolate,
        solid_density=solid_density,
        solid_slope=solid_slope,
    )
